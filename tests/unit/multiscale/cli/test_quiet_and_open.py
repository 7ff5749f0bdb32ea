"""Commands can be quiet, open their report, print without colours, and be completed by a shell."""

import os
import pty
import re
import shutil
import subprocess
import sys
import webbrowser

import pytest
from helpers.mpi_environment import BESIDE_OTHERS
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale.cli.about import completion
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.scene.schema import scene_keys


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SMALL_SCENE)
    return path


def test_quiet_run_prints_nothing(scene, tmp_path, capsys):
    words = ["run", str(scene), "--out", str(tmp_path / "out")]
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert (tmp_path / "out" / "history.csv").is_file()
    assert main([*words, "-q", "--set", "load.approach=1"]) == 2  # other results are there
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err.startswith("patchlaw: ")
    assert main(words) == 0
    assert "results in" in capsys.readouterr().out  # the next command is not quiet


def test_quiet_run_prints_cautions(scene, tmp_path, capsys):
    words = ["accuracy=1e-6", "output.check=last"]
    assert main(["run", str(scene), "--out", str(tmp_path / "out"), "-q", "--set", *words]) == 0
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("caution: the accuracy of 0.0001 % is not kept")
    assert shown.err.count("\n") == 1 and "note:" not in shown.err


def test_sweeps_say_cautions_as_such(scene, tmp_path, capsys):
    """Also quietly, with the cases that they are of: one strains its body too much."""
    words = ["sweep", str(scene), "--out", str(tmp_path / "out"), "--overwrite"]
    words += ["--vary", "block.young_modulus=1 GPa,1 TPa", "--set", "load.pressure=30"]
    first = 'caution: 1 of 2 cases, as {"block.young_modulus": "1 GPa"}: a mean pressure of 30 MPa'
    assert main(words) == 0
    assert first in " ".join(capsys.readouterr().out.split())
    assert main([*words, "--quiet"]) == 0
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err.startswith(first) and "note:" not in shown.err


@pytest.mark.long
def test_a_pipe_gets_a_line_for_each_load_step_as_it_is_done(scene, tmp_path):
    """Of all phases and load steps, long before the end: what a log shows of a run under way."""
    words = ["-m", "patchlaw", "run", str(scene), "--out", str(tmp_path / "out"), "--overwrite"]
    asked = ["--set", "load.steps=3", "output.check=last", "coupling.kind=consistent"]
    with subprocess.Popen(
        [sys.executable, *words, *asked], stdout=subprocess.PIPE, text=True
    ) as process:
        first = process.stdout.readline()
        assert process.poll() is None
        lines = [first, *process.stdout]
    assert process.returncode == 0
    timed = [line[9:].strip() for line in lines if re.match(r"\d\d:\d\d:\d\d ", line)]
    for begin in ("laws", "rows of laws: ", "load steps", "load step 1/3: ", "load step 3/3: ",
                  "check", "writing"):  # fmt: skip
        assert any(line.startswith(begin) for line in timed), begin
    assert re.search(r"; about .* left$", next(line for line in timed if "step 1/3" in line))
    del asked[1:]
    silent = [sys.executable, *words, "--progress", "none", *asked, "load.steps=3"]
    out = subprocess.run(silent, capture_output=True, text=True, check=True).stdout
    assert "results in" in out and "load step 1" not in out


@pytest.mark.long
def test_report_is_opened(scene, tmp_path, capsys, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda page: opened.append(page) or len(opened) < 3)
    words = ["run", str(scene), "--out", str(tmp_path / "out"), "--open", "--set"]
    assert main([*words, "output.report=true"]) == 0
    assert opened == [(tmp_path / "out" / "report.html").resolve().as_uri()]
    both = ["compare", *[str(tmp_path / "out")] * 2, "--out", str(tmp_path / "both"), "--open"]
    assert main(both) == 0
    assert opened[1].endswith("/both/diff.html")
    assert main(both) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "note: no browser was found to open" in said
    assert main([*words, "output.report=false"]) == 0
    assert "no report was written that could be opened" in capsys.readouterr().out
    assert len(opened) == 3


@pytest.mark.long
@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("colour", [True, False])
def test_colours_are_off_where_the_user_says_so(scene, tmp_path, ranks, colour):
    """Errors and plans are printed to a terminal, in colours unless NO_COLOR or mpirun is there."""
    told, terminal = pty.openpty()
    # a bar moves the cursor, whatever colours there are
    program = [sys.executable, "-m", "patchlaw", "plan", str(scene), "--progress", "none"]
    launcher = [] if ranks == 1 else ["mpirun", "-n", str(ranks), "--oversubscribe"]
    environment = (
        os.environ | BESIDE_OTHERS | {"TERM": "xterm"} | ({} if colour else {"NO_COLOR": "1"})
    )
    if colour:
        environment.pop("NO_COLOR", None)
    done = subprocess.Popen(
        [*launcher, *program], stdout=terminal, stderr=terminal, env=environment
    )
    os.close(terminal)
    text = b""
    while True:
        try:
            part = os.read(told, 4096)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        text += part
    os.close(told)
    assert done.wait() == 0, text.decode()
    assert b"coupling" in text
    # Open MPI gives its first rank a terminal of its own, also where its output is a log
    assert (b"\x1b[" in text) == (colour and ranks == 1)


def completed(*words, shell="bash"):
    """Return what a shell offers for the last of some words."""
    listed = " ".join(f"'{word}'" for word in words)
    script = (
        f"{completion(shell)}\nCOMP_WORDS=({listed})\nCOMP_CWORD={len(words) - 1}\n_patchlaw\n"
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_shell_completes_commands_options_values_keys_and_files(tmp_path, monkeypatch):
    assert completed("patchlaw", "co") == ["compare", "completion"]
    assert completed("patchlaw", "run", "--re") == ["--resume"]
    assert "--quiet" in completed("patchlaw", "run", "--")
    assert completed("patchlaw", "compare", "a", "b", "--at", "p") == ["pressure"]
    assert completed("patchlaw", "completion", "") == ["bash", "zsh"]
    assert completed("patchlaw", "run", "s.toml", "--set", "load.ti") == ["load.tilt="]
    keys = completed("patchlaw", "run", "s.toml", "--set", "load.steps=2", "")
    assert keys == [f"{key.name}=" for key in scene_keys().values() if not key.is_section]
    (tmp_path / "my.toml").touch()
    monkeypatch.chdir(tmp_path)
    assert completed("patchlaw", "run", "my") == ["my.toml"]
    assert completed("patchlaw", "run", "my.toml", "--out", "m") == ["my.toml"]


def test_shells_are_those_that_are_known(capsys):
    assert main(["completion", "fish"]) == 2
    assert "invalid choice: 'fish'" in capsys.readouterr().err
    assert main(["completion", "zsh"]) == 0
    assert capsys.readouterr().out.startswith("#compdef patchlaw")
