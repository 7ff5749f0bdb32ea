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


@pytest.mark.parametrize("name", dir(patchlaw))
def test_names_are_those_of_the_packages(name):
    found = getattr(patchlaw, name)
    assert [found] == [getattr(one, name) for one in PACKAGES.values() if hasattr(one, name)][:1]
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


LAZY = [(package, name) for package in PACKAGES.values() for name in dir(package)]


@pytest.mark.parametrize(("package", "name"), LAZY, ids=lambda one: getattr(one, "__name__", one))
def test_the_stub_names_the_modules_of_all_names(package, name):
    assert getattr(package, name) is not None
    assert name in package.__all__


def test_a_name_that_is_also_a_module_is_what_the_module_defines():
    import geometry.facing

    assert callable(geometry.facing) and callable(multiscale.run)
