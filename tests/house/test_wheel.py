"""sdist and wheel: what is in them, and that the wheel works where nothing but numpy and scipy is.

A clean copy of the project is built as packagers do, installed in an environment without the
system's packages, and asked for contacts; then for what it cannot do there.
"""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

import pytest

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
PACKAGES = ("geometry", "macro", "micro", "multiscale", "support")
CONTACTS = """
import sys
from micro import MODEL_NAMES, micro_model
from patchlaw import Control, HalfSpaceModel, Spectrum, synthesise
spectrum = Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=7)
surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
load = Control(approach=2e-3)
print(HalfSpaceModel(surface, contact_modulus=4000.0, periodic=True).press(load).force)
for name in MODEL_NAMES:
    print(micro_model(name, surface, contact_modulus=4000.0).press(load).force)
"""
EVERY_MODULE = """
import importlib, pkgutil, geometry, micro, support
for package in (geometry, micro, support):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
"""
SCENE = """
[surface]
spectrum = { hurst = 0.95, waves = [2, 10], rms_slope = 0.215, seed = 1 }
grid = [32, 32]
lengths = ["1 mm", "1 mm"]
[block]
height = "1 mm"
young_modulus = "4 GPa"
poisson_ratio = 0.15
[load]
approach = "4 um"
steps = 2
[output]
fields = false
"""


def call(*words, cwd, check=True, **variables):
    environment = os.environ | variables
    done = subprocess.run(
        words, cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 or not check, done.stdout + done.stderr
    return done


def files_of_git(*within):
    """Return the files that git knows or would add."""
    kinds = ("--cached", "--others", "--exclude-standard")
    return set(call("git", "ls-files", *kinds, *within, cwd=ROOT).stdout.splitlines())


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return sdist and wheel of a copy of the project."""
    tree, out = (tmp_path_factory.mktemp(name) for name in ("tree", "dist"))
    for name in files_of_git():
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            (tree / name).write_bytes((ROOT / name).read_bytes())
    call(sys.executable, "-m", "build", "--outdir", out, tree, cwd=tree)  # the wheel of the sdist
    (sdist,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return sdist, wheel


@pytest.fixture(scope="module")
def bare(built, tmp_path_factory):
    """Return an environment that has the wheel, numpy and scipy."""
    folder = tmp_path_factory.mktemp("bare")
    call("/usr/bin/python3", "-m", "venv", folder, cwd=folder)
    call(folder / "bin" / "pip", "install", "--only-binary", ":all:", built[1], cwd=folder)
    return folder


def test_the_wheel_holds_the_packages_and_nothing_else(built):
    names = set(zipfile.ZipFile(built[1]).namelist())
    metadata = {name for name in names if ".dist-info/" in name}
    assert names - metadata == files_of_git(*PACKAGES, "patchlaw.py")
    assert {PurePosixPath(name).name for name in metadata} >= {"METADATA", "LICENSE", "RECORD"}


def test_the_sdist_holds_what_the_wheel_is_built_from(built):
    with tarfile.open(built[0]) as archive:
        names = {
            str(PurePosixPath(*PurePosixPath(one.name).parts[1:]))
            for one in archive
            if one.isfile() and ".egg-info/" not in one.name
        }
    beside = {"LICENSE", "PKG-INFO", "README.md", "pyproject.toml", "setup.cfg"}
    assert names == files_of_git(*PACKAGES, "patchlaw.py") | beside


def test_only_numpy_and_scipy_come_with_it(bare):
    listed = call(bare / "bin" / "pip", "list", "--format=freeze", cwd=bare).stdout.split()
    installed = {line.partition("==")[0].lower() for line in listed}
    assert installed - {"pip", "setuptools", "wheel"} == {"numpy", "patchlaw", "scipy"}


def test_contacts_are_those_of_the_repository(bare):
    there, here = (
        [float(line) for line in call(python, "-c", CONTACTS, cwd=bare).stdout.split()]
        for python in (bare / "bin" / "python", sys.executable)
    )
    assert len(here) == 6 and min(here) > 0.1
    # other releases of numpy and scipy round differently; 5e-14 measured
    assert there == pytest.approx(here, rel=1e-10)


def test_every_module_of_geometry_micro_and_support_is_imported(bare):
    call(bare / "bin" / "python", "-c", EVERY_MODULE, cwd=bare)


WITH_PIP = "scenes, figures and files need it: pip install 'patchlaw[scenes]'"
OF_DOLFINX = "bodies of finite elements need it: take dolfinx"


@pytest.mark.parametrize(
    ("code", "missing", "remedy"),
    [
        ("patchlaw.Scene", "pydantic", WITH_PIP),
        ("patchlaw.run", "pydantic", WITH_PIP),
        ("multiscale.read_laws('laws.h5')", "h5py", WITH_PIP),
        ("patchlaw.History.plot(None)", "matplotlib", WITH_PIP),
        ("patchlaw.ContactProblem", "dolfinx", OF_DOLFINX),
        ("gmsh_session('box').__enter__()", "gmsh", OF_DOLFINX),
    ],
)
def test_what_is_missing_is_named(bare, code, missing, remedy):
    line = f"import patchlaw, multiscale; from geometry.meshes.gmsh_session import *; {code}"
    done = call(bare / "bin" / "python", "-c", line, cwd=bare, check=False)
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"support.errors.NotInstalled: {missing} is not installed, and {remedy}")


def test_the_command_names_what_is_missing(bare):
    command = bare / "bin" / "patchlaw"
    assert "usage: patchlaw" in call(command, "--help", cwd=bare).stdout
    done = call(command, "run", "scene.toml", cwd=bare, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("patchlaw: rich is not installed") and WITH_PIP in done.stderr


def test_with_the_extra_scenes_without_finite_elements_run(built, bare):
    pip, command = bare / "bin" / "pip", bare / "bin" / "patchlaw"
    call(pip, "install", "--only-binary", ":all:", f"{built[1]}[scenes]", cwd=bare)
    (bare / "scene.toml").write_text(SCENE, encoding="utf-8")
    words = ("run", "scene.toml", "--set", "micro.model=half-space", "--set")
    call(command, *words, "coupling.kind=analytic", cwd=bare)
    assert {path.name for path in (bare / "results" / "scene").iterdir()} >= {
        "history.csv", "report.html", "curves.png"
    }  # fmt: skip
    words = (*words, "coupling.kind=concurrent", "--out", "other")
    done = call(command, *words, cwd=bare, check=False, PATCHLAW_CACHE="off")
    assert done.returncode == 2, done.stderr
    assert "is not installed, and bodies of finite elements need it" in " ".join(
        done.stderr.split()
    )
