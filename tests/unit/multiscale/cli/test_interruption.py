"""A run that is told to stop, or short of time, stops between two load steps and goes on later."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from patchlaw.multiscale import Run
from patchlaw.multiscale.cli import about
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.cli.interruption import Ended, Stopped, signals_raise, watching
from patchlaw.support import InputError
from patchlaw.support.quantities import parse_duration

PAPER = str(Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml")
SMALL = [
    "--set", "surface.grid=[32, 32]", "coupling.kind=analytic", "micro.model=half-space",
    "load.steps=4", "output.figures=false",
]  # fmt: skip


def rows(folder):
    """Return what history.csv and patches.csv hold but for wall times."""
    history = (folder / "history.csv").read_text(encoding="utf-8").splitlines()
    kept = [row.split(",")[:9] + row.split(",")[10:] for row in history]
    return kept, (folder / "patches.csv").read_text(encoding="utf-8").splitlines()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed")
    assert main(["run", PAPER, "--out", str(out), *SMALL]) == 0
    return rows(out)


def disturb(monkeypatch, change):
    """Let something happen with every load step of a run."""
    steps = Run.load_steps

    def changed(self):
        for step in steps(self):
            yield change(step)

    monkeypatch.setattr(Run, "load_steps", changed)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code", "text"), [
    (signal.SIGINT, 130, "interrupted (SIGINT)"), (signal.SIGTERM, 143, "terminated (SIGTERM)"),
    (signal.SIGHUP, 129, "hung up (SIGHUP)"), (signal.SIGUSR1, 4, "told to stop (SIGUSR1)"),
])  # fmt: skip
def test_signal_stops_after_the_load_step(
    capfd, tmp_path, monkeypatch, undisturbed, number, code, text
):
    def send(step):
        if step.step == 2:
            os.kill(os.getpid(), number)
        return step

    words = ["run", PAPER, "--out", str(tmp_path), *SMALL]
    handlers = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    with monkeypatch.context() as patch:
        disturb(patch, send)
        assert main(words) == code
    shown = capfd.readouterr()
    assert f"{text}: stopped after load step 2; go on with --resume" in shown.err
    assert "report.html" in shown.out
    assert rows(tmp_path)[0] == undisturbed[0][:3]
    assert (tmp_path / "checkpoint.state").exists()
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == handlers
    assert main([*words[:2], "--resume", *words[2:]]) == 0
    assert "goes on after load step 2" in capfd.readouterr().out
    assert rows(tmp_path) == undisturbed
    assert not list(tmp_path.glob("checkpoint*"))


def test_second_signal_is_not_held_back():
    with watching(None) as interruption:
        os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_DFL
        with pytest.raises(Stopped, match="stopped here"):
            interruption.check("here")


def test_load_step_that_would_last_too_long_is_not_begun(capfd, tmp_path, monkeypatch, undisturbed):
    words = ["run", PAPER, "--out", str(tmp_path), "--max-time", "1 h", *SMALL]
    with monkeypatch.context() as patch:
        disturb(patch, lambda step: replace(step, wall_s=2500.0))  # the next would take 1.5 times
        assert main(words) == 4
    text = "the time is nearly over: stopped after load step 1; go on with --resume"
    assert text in capfd.readouterr().err
    assert main([*words[:2], "--resume", *words[2:]]) == 0
    assert rows(tmp_path) == undisturbed


def test_no_time_at_all_keeps_what_there_is(capfd, tmp_path):
    words = ["run", PAPER, "--out", str(tmp_path), "--max-time", "1 s", *SMALL]
    assert main(words) == 4
    assert "stopped before the block was made" in capfd.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint.state"]  # no load step yet


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("55m", 3300.0), ("55 min", 3300.0), ("1.5 h", 5400.0), ("90 s", 90.0), ("2 days", 172800.0)],
)
def test_durations(text, seconds):
    assert parse_duration(text) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.parametrize(("text", "problem"), [
    ("90", 'has no unit .*such as "55 min"'), ("5 mm", "has the wrong unit"),
    ("soon", "cannot be read as a quantity"), ("0 s", "must be greater than 0"),
    ("-5 min", "must be greater than 0"),
])  # fmt: skip
def test_what_is_no_duration(capsys, text, problem):
    with pytest.raises(ValueError, match=problem):
        parse_duration(text)
    assert main(["run", PAPER, f"--max-time={text}"]) == 2
    assert f"argument --max-time: '{text}': " in capsys.readouterr().err
    assert issubclass(InputError, ValueError)


def test_a_notice_after_the_end_does_not_kill():
    """A batch system tells the end of the time whenever it likes."""
    code = (
        "import os, signal; from patchlaw.multiscale.cli.interruption import watching\n"
        "with watching(None): pass\n"
        "os.kill(os.getpid(), signal.SIGUSR1)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_nohup_is_obeyed():
    former = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with signals_raise(), watching(None) as interruption:
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            os.kill(os.getpid(), signal.SIGHUP)
            interruption.check("here")
    finally:
        signal.signal(signal.SIGHUP, former)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_what_is_told_to_end_clears_away(number):
    left, former = [], signal.getsignal(number)
    with pytest.raises(Ended) as ended, signals_raise():
        try:
            os.kill(os.getpid(), number)
        finally:
            left.append("cleared")
    assert left == ["cleared"]
    assert ended.value.exit_code == 128 + number
    assert signal.getsignal(number) == former


@pytest.mark.long
def test_a_notice_of_the_time_limit_ends_a_sweep_in_time(tmp_path):
    """What its cases came to is kept, nothing half-written, and the same call goes on."""
    out, many = tmp_path / "out", "surface.spectrum.seed=0..400"
    words = [sys.executable, "-m", "patchlaw", "sweep", PAPER, "--vary", many, *SMALL]
    process = subprocess.Popen([*words, "--out", str(out)], stderr=subprocess.PIPE, text=True)
    journal = out / ".cases"
    until = time.monotonic() + 100.0
    while not any(one.stat().st_size for one in out.glob("**/*.cases")):
        assert process.poll() is None and time.monotonic() < until, journal
        time.sleep(0.05)
    process.send_signal(signal.SIGUSR1)
    assert process.wait(60.0) == 4
    assert not list(out.glob("**/*partial*")) and not list(out.glob("*.csv"))


HUNG_UP = """
import os, signal, sys
from patchlaw.multiscale.cli import about, command_line

def hung_up(choice, options, comm):
    import patchlaw.macro.bodies
    from petsc4py import PETSc
    os.kill(os.getpid(), signal.SIGHUP)
    print("went on")

about.print_schema = hung_up
sys.exit(command_line.main(["schema"]))
"""


@pytest.mark.long
def test_petsc_and_mpi_do_not_take_the_signals(root):
    done = subprocess.run(
        [sys.executable, "-c", HUNG_UP], cwd=root, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (129, "", "")


TOLD_WHILE_IMPORTING = """
import os, signal, sys
from patchlaw.multiscale.cli import about, command_line

def importing(choice, options, comm):
    def told(event, arguments):
        if event == "import" and arguments[0] == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGTERM)

    sys.addaudithook(told)
    import patchlaw.macro.bodies
    print("went on")

about.print_schema = importing
sys.exit(command_line.main(["schema"]))
"""


@pytest.mark.long
@pytest.mark.parametrize("module", ["dolfinx.cpp", "petsc4py.PETSc"])
def test_a_signal_while_finite_elements_are_imported_ends_with_its_code(root, module):
    """Compiled modules turn what interrupts their import into an ImportError of their own."""
    done = subprocess.run(
        [sys.executable, "-c", TOLD_WHILE_IMPORTING, module],
        cwd=root, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "")


def test_a_signal_that_becomes_another_error_ends_with_its_code(monkeypatch, capsys):
    def converted(choice, options, comm):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            raise ImportError("initialization failed", name="dolfinx") from None

    monkeypatch.setattr(about, "print_schema", converted)
    assert main(["schema"]) == 143
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(about, "print_schema", lambda *_: 1 / 0)
    assert main(["schema"]) == 1  # a signal of an earlier command is no excuse
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_signal_is_seen_though_standard_error_is_full():
    code = (
        "import os, signal\n"
        "from patchlaw.multiscale.cli.interruption import Stopped, watching\n"
        "with watching(None) as watch:\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    try: watch.check('after load step 1')\n"
        "    except Stopped as told: os._exit(told.exit_code)\n"
    )
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code], stderr=full, cwd=Path(__file__).parents[4], check=False
        )
    assert done.returncode == 143
