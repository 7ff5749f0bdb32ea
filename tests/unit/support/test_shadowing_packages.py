"""Packages of an environment that stand before those that compiled parts were built with."""

import subprocess
import sys

import pytest

from patchlaw.support.packages import removal, shadows


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
