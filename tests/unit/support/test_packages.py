"""Packages that are missing or fail to load: told by name, and figures do without."""

import os
import subprocess
import sys

import pytest

from patchlaw.support import NotInstalled
from patchlaw.support.packages import optional_packages

COMMAND = "import sys; from patchlaw.__main__ import main; sys.exit(main())"
BROKEN = {
    "oserror": "raise OSError('libGLU.so.1: cannot open shared object file')",
    "importerror": "raise ImportError('numpy.core.multiarray failed to import')",
    "attributeerror": "import numpy; numpy.gone",
}


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """Put packages before all others whose import fails."""

    def put(name, how):
        folder = tmp_path / "broken"
        folder.mkdir(exist_ok=True)
        (folder / f"{name}.py").write_text(BROKEN[how], encoding="utf-8")
        return {"PYTHONPATH": str(folder)}

    return put


@pytest.fixture
def command(root, tmp_path):
    """Run the command line in a process of its own."""

    def run(environment, *words):
        return subprocess.run(
            [sys.executable, "-c", COMMAND, *words],
            cwd=root, env=os.environ | environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    return run


PAPER = "demos/scenes/paper.toml"
ALONE = ["coupling.kind=analytic", "micro.model=half-space", "surface.grid=[32, 32]",
         "load.steps=1"]  # fmt: skip


@pytest.mark.parametrize("how", BROKEN)
def test_packages_that_fail_to_load_are_told_by_name(broken, monkeypatch, how):
    monkeypatch.syspath_prepend(broken("pint", how)["PYTHONPATH"])
    monkeypatch.delitem(sys.modules, "pint", raising=False)
    with (
        pytest.raises(NotInstalled, match=r"pint cannot be imported \(.*\), and scenes, figures"),
        optional_packages(),
    ):
        import pint  # noqa: F401


def test_results_do_without_a_matplotlib_that_fails_to_load(broken, command, tmp_path):
    out = tmp_path / "out"
    words = ["run", PAPER, "--out", str(out), "--set", *ALONE, "output.figures=true"]
    done = command(broken("matplotlib", "oserror"), *words)
    assert (done.returncode, done.stderr) == (0, "")
    assert "no figures are drawn: matplotlib cannot be imported (" in " ".join(done.stdout.split())
    assert {"history.csv", "patches.csv", "report.html"} <= {path.name for path in out.iterdir()}
    assert not list(out.glob("*.png"))
    assert "no figures are drawn" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.long
@pytest.mark.parametrize("words", [["surface"], ["sweep", "--vary", "surface.spectrum.seed=1,2"]])
def test_other_commands_do_without_figures_too(broken, command, tmp_path, words):
    more = [*words[1:], "--out", str(tmp_path / "out"), "--set", *ALONE, "output.figures=true"]
    done = command(broken("matplotlib", "oserror"), words[0], PAPER, *more)
    assert (done.returncode, done.stderr) == (0, "")
    assert "no figures are drawn: matplotlib cannot be imported (" in " ".join(done.stdout.split())


def test_errors_of_our_own_code_stay_what_they_are():
    for error in (OSError("full"), ImportError("no", name="geometry.gone"), ZeroDivisionError()):
        with pytest.raises(type(error)) as found, optional_packages():
            raise error
        assert found.value is error


def test_missing_package_is_said_to_be_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pint", None)
    with (
        pytest.raises(NotInstalled, match=r"pint is not installed, and scenes, figures"),
        optional_packages(),
    ):
        import pint  # noqa: F401
