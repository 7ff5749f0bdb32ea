"""``import patchlaw`` has what users need, and loads nothing before it is asked for."""

import subprocess
import sys

import pytest

import geometry
import macro
import micro
import multiscale
import patchlaw

PACKAGES = {"geometry": geometry, "micro": micro, "multiscale": multiscale, "macro": macro}


def test_names_are_those_of_the_packages():
    for name in dir(patchlaw):
        homes = [one for one in PACKAGES.values() if hasattr(one, name)]
        assert homes and getattr(patchlaw, name) is getattr(homes[0], name), name
        assert name in patchlaw.__all__


def test_other_names_are_errors():
    with pytest.raises(AttributeError, match="has no attribute 'surface'"):
        patchlaw.surface  # noqa: B018


def test_importing_it_loads_nothing(root):
    loaded = (
        "import patchlaw, sys; print(sorted({'numpy', 'micro', 'geometry'} & set(sys.modules)))"
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


def test_a_name_that_is_also_a_module_is_what_the_module_defines():
    import geometry.facing

    assert callable(geometry.facing) and callable(multiscale.run)
