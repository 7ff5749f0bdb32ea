"""``import patchlaw`` has what users need, and loads nothing before it is asked for."""

import subprocess
import sys
from pathlib import Path

import pytest

import patchlaw
from patchlaw import geometry, macro, micro, multiscale, support

PACKAGES = {
    "support": support, "geometry": geometry, "micro": micro, "multiscale": multiscale,
    "macro": macro,
}  # fmt: skip


def test_names_are_those_of_the_packages():
    for name in dir(patchlaw):
        homes = [one for one in PACKAGES.values() if hasattr(one, name)]
        assert homes and getattr(patchlaw, name) is getattr(homes[0], name), name
        assert name in patchlaw.__all__


def test_other_names_are_errors():
    with pytest.raises(AttributeError, match="No patchlaw attribute surface"):
        patchlaw.surface  # noqa: B018


def test_importing_it_loads_nothing(root):
    loaded = (
        "import patchlaw, sys; heavy = {'numpy', 'patchlaw.micro', 'patchlaw.geometry'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    found = subprocess.run(
        [sys.executable, "-c", loaded], cwd=root, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("package", PACKAGES.values(), ids=PACKAGES)
def test_the_stub_names_the_modules_of_all_names(package):
    assert dir(package)
    for name in dir(package):
        assert getattr(package, name) is not None, name
        assert name in package.__all__, name


@pytest.mark.parametrize("package", PACKAGES.values(), ids=PACKAGES)
def test_no_module_has_a_public_name(package):
    """Its import would replace what the name stands for in its package."""
    folder = Path(str(package.__file__)).parent
    assert not {path.stem for path in folder.iterdir()} & set(dir(package))
