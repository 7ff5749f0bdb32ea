"""Packages that are missing or fail to load: told by name, and figures do without."""

import os
import subprocess
import sys

import pytest

from patchlaw.support import NotInstalled
from patchlaw.support.packages import optional_packages, removal, shadows

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


@pytest.fixture
def path(tmp_path):
    """Return folders as those of an environment over a distribution's packages."""
    folders = [tmp_path / "site-packages", tmp_path / "dist-packages"]
    for folder, version in zip(folders, ("2.4.6", "1.24.2"), strict=True):
        (folder / "numpy").mkdir(parents=True)
        (folder / "numpy" / "__init__.py").write_text("raise ImportError('of another ABI')\n")
        (folder / f"numpy-{version}.dist-info").mkdir()
    return folders


def test_the_first_of_two_shadows_the_distributions(path):
    found = shadows([str(folder) for folder in path])
    assert list(found) == ["numpy"]
    assert found["numpy"].startswith(
        f"numpy in {path[0]} shadows the distribution's in {path[1]}, which dolfinx"
    )
    assert removal(found) == f"remove with: {sys.executable} -m pip uninstall numpy"


def test_one_alone_shadows_nothing(path):
    assert shadows([str(path[1])]) == {}
    assert shadows([str(path[0]), str(path[0])]) == {}  # of no distribution that it could shadow


def test_commands_name_what_shadows_and_how_to_remove_it(path):
    code = (
        f"import sys; sys.path[:0] = [{str(path[0])!r}]; sys.path.append({str(path[1])!r});"
        "from patchlaw.multiscale.cli.command_line import main;"
        "sys.exit(main(['plan', 'any.toml']))"
    )
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert shown.returncode == 2 and shown.stdout == ""
    for part in ("numpy in", "together they fail: of another ABI", "pip uninstall numpy"):
        assert part in shown.stderr
    assert "report" not in shown.stderr and "Traceback" not in shown.stderr
