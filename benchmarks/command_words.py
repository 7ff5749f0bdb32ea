"""Command lines as users could type them, and how the program may answer."""

from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO

from hypothesis import strategies as st

from benchmarks.scene_inputs import KEYS, odd_text
from patchlaw.multiscale.cli.command_line import main

COMMANDS = (
    "run", "run", "plan", "compare", "laws", "surface", "schema", "doctor", "warm", "init", "help",
)  # fmt: skip
SCENE = "SCENE"  # stands for the scene file
GOOD = (
    "--out out", "--out out/deeper", "--set output.figures=false", "--resume", "--overwrite",
    "--set load.steps=1 micro.model=elliptic", "--set load.tilt=free",
    "--set coupling.kind=isolated block.cells=[4,4,3]",
    "--set output.report=false load.force=0.1", "--export csv", "--export 4c --export calculix",
)  # fmt: skip
ODD = (
    "--out .", "--out /dev/null", "--out /proc/nowhere", "--out", "--resume", "--max-time 55m",
    "--max-time 1ms", "--max-time soon", "--max-time", "--against reference", "--at pressure",
    "--set", "--element Q1", "--element Q9", "-- -ksp_rtol 1e-9", "-- nothing", "--",
    "-h", "-x", "--export step", "--export", "SCENE", "/dev/null",
)  # fmt: skip
changes = st.builds("--set {}={}".format, st.sampled_from(sorted(KEYS)), odd_text)
odd_words = st.one_of(st.sampled_from(ODD), changes, odd_text)
# what would take its time when it is right: a level or a form of its own, a look at the machine
DEAR = {"compare", "doctor", "warm"}
ALONE = {"schema", "doctor", "warm"}


@st.composite
def command_lines(draw):
    """Draw the words of a command line, mostly of the right form."""
    command = draw(st.sampled_from(COMMANDS) if draw(st.integers(0, 9)) else odd_text)
    words = [command] if command in ALONE or not draw(st.integers(0, 9)) else [command, SCENE]
    for drawn in draw(st.lists(st.sampled_from(GOOD), max_size=2)):
        words += drawn.split(" ")
    if draw(st.booleans()):
        words += draw(odd_words).split(" ")
    return words if command not in DEAR else [*words, "--nothing"]


lines = command_lines()


def called(scene, words):
    """Run a command line in the scene's folder; return how it ended, by its exit code."""
    words = [str(scene) if word == SCENE else word for word in words]
    told = StringIO()
    with chdir(scene.parent), redirect_stdout(StringIO()), redirect_stderr(told):
        code = main(words)
    assert code in (0, 2, 3, 4, 5), (words, code, told.getvalue())
    shown = told.getvalue()
    assert "Traceback" not in shown
    assert (code == 0) or (shown.startswith("patchlaw: ") and shown.count("\n") == 1), shown
    return f"exit code {code}"
