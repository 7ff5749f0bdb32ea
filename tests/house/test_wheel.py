"""sdist and wheel: what is in them, and that the wheel works where nothing but numpy and scipy is.

A clean copy of the project is built as packagers do, installed in an environment without the
system's packages, and asked for contacts; then for what it cannot do there. With what scenes need
beside it, and then with dolfinx's wheels where Python is new enough, it is asked for all else.
"""

import csv
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

import numpy as np
import pytest
from helpers.box_msh import write_box
from helpers.mpi_environment import MPI_ENVIRONMENT

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
PACKAGES = ("geometry", "macro", "micro", "multiscale", "support")
INSTALL = ("install", "--no-compile", "--only-binary", ":all:")
"""Words of pip, which need not compile the thousands of modules that come with it."""
CONTACTS = """
import sys
from patchlaw.micro import MODEL_NAMES, micro_model
from patchlaw import Control, HalfSpaceModel, Spectrum, synthesise
spectrum = Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=7)
surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
load = Control(approach=2e-3)
print(HalfSpaceModel(surface, contact_modulus=4000.0, periodic=True).press(load).force)
for name in MODEL_NAMES:
    print(micro_model(name, surface, contact_modulus=4000.0).press(load).force)
"""
EVERY_MODULE = """
import importlib, pkgutil
from patchlaw import geometry, micro, support
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
    """Return an environment that has the wheel, numpy and scipy; later tests put more into it."""
    folder = tmp_path_factory.mktemp("bare")
    call(newer_python() or "/usr/bin/python3", "-m", "venv", folder, cwd=folder)
    call(folder / "bin" / "pip", *INSTALL, built[1], cwd=folder)
    return folder


def test_the_wheel_holds_the_packages_and_nothing_else(built):
    names = set(zipfile.ZipFile(built[1]).namelist())
    metadata = {name for name in names if ".dist-info/" in name}
    mapped = {f"patchlaw/{name}" for name in files_of_git(*PACKAGES)}
    assert names - metadata == mapped | files_of_git("patchlaw")
    assert next(name for name in metadata if name.endswith("/top_level.txt"))
    assert {PurePosixPath(name).name for name in metadata} >= {"METADATA", "LICENSE", "RECORD"}


def test_the_sdist_holds_what_the_wheel_is_built_from(built):
    with tarfile.open(built[0]) as archive:
        names = {
            str(PurePosixPath(*PurePosixPath(one.name).parts[1:]))
            for one in archive
            if one.isfile() and ".egg-info/" not in one.name
        }
    beside = {"LICENSE", "PKG-INFO", "README.md", "pyproject.toml", "setup.cfg"}
    assert names == files_of_git(*PACKAGES, "patchlaw") | beside


@pytest.mark.slow
def test_a_users_own_modules_of_any_name_are_not_in_its_way(bare, tmp_path):
    (tmp_path / "geometry.py").write_text("", encoding="utf-8")
    line = "import geometry, patchlaw; print(patchlaw.Surface.__module__, geometry.__file__)"
    shown = call(bare / "bin" / "python", "-c", line, cwd=tmp_path).stdout.split()
    assert shown == ["patchlaw.geometry.surface", str(tmp_path / "geometry.py")]


def test_little_but_numpy_and_scipy_comes_with_it(bare):
    listed = call(bare / "bin" / "pip", "list", "--format=freeze", cwd=bare).stdout.split()
    installed = {line.partition("==")[0].lower() for line in listed}
    assert installed - {"pip", "setuptools", "wheel"} == {
        "lazy-loader", "numpy", "packaging", "patchlaw", "scipy"
    }  # fmt: skip


def test_contacts_are_those_of_the_repository(bare):
    """Also where Python is started in the project's folder, whose `patchlaw` is found first."""
    there, beside, here = (
        [float(line) for line in call(python, "-Bc", CONTACTS, cwd=folder).stdout.split()]
        for python, folder in (
            (bare / "bin" / "python", bare),
            (bare / "bin" / "python", ROOT),
            (sys.executable, bare),
        )
    )
    assert len(here) == 6 and min(here) > 0.1
    assert beside == there
    # other releases of numpy and scipy round differently; 5e-14 measured
    assert there == pytest.approx(here, rel=1e-10)


def test_every_module_of_geometry_micro_and_support_is_imported(bare):
    call(bare / "bin" / "python", "-c", EVERY_MODULE, cwd=bare)


WITH_PIP = "scenes, figures and files need it: pip install 'patchlaw[scenes]'"
OF_DOLFINX = "bodies of finite elements need it: take dolfinx"


@pytest.mark.parametrize(("code", "missing", "remedy"), [
    ("patchlaw.Scene", "pydantic", WITH_PIP), ("patchlaw.run", "pydantic", WITH_PIP),
    ("patchlaw.multiscale.read_laws('laws.h5')", "h5py", WITH_PIP),
    ("patchlaw.History.plot(None)", "matplotlib", WITH_PIP),
    ("patchlaw.ContactProblem", "dolfinx", OF_DOLFINX),
])  # fmt: skip
def test_what_is_missing_is_named(bare, code, missing, remedy):
    words = "-c", f"import patchlaw.multiscale; {code}"
    done = call(bare / "bin" / "python", *words, cwd=bare, check=False)
    last = done.stderr.splitlines()[-1]
    assert last.startswith(
        f"patchlaw.support.errors.NotInstalled: {missing} is not installed, and {remedy}"
    )


def test_the_command_names_what_is_missing(bare):
    command = bare / "bin" / "patchlaw"
    assert "usage: patchlaw" in call(command, "--help", cwd=bare).stdout
    done = call(command, "run", "scene.toml", cwd=bare, check=False)
    assert done.returncode == 2
    assert re.match(r"patchlaw: \w+ is not installed, and scenes", done.stderr), done.stderr
    assert WITH_PIP in done.stderr and "Traceback" not in done.stderr


def test_with_the_extra_scenes_without_finite_elements_run(built, bare):
    pip, command = bare / "bin" / "pip", bare / "bin" / "patchlaw"
    call(pip, *INSTALL, f"{built[1]}[scenes]", cwd=bare)
    (bare / "scene.toml").write_text(SCENE, encoding="utf-8")
    words = ("run", "scene.toml", "--set", "micro.model=half-space", "--set")
    call(command, *words, "coupling.kind=analytic", "--out", "results", cwd=bare)
    assert {path.name for path in (bare / "results").iterdir()} >= {
        "history.csv", "report.html", "curves.png"
    }  # fmt: skip
    on_block = (*words, "coupling.kind=concurrent", "--out", "block")
    call(command, *on_block, cwd=bare, PATCHLAW_CACHE="off")
    words = (*words, "coupling.kind=consistent", "coupling.interface=pointwise", "--out", "other")
    done = call(command, *words, cwd=bare, check=False, PATCHLAW_CACHE="off")
    assert done.returncode == 2, done.stderr
    assert "is not installed, and bodies of finite elements need it" in " ".join(
        done.stderr.split()
    )


BODY = """
[surface]
spectrum = { hurst = 0.9, waves = [2, 4], rms_slope = 0.2, seed = 3 }
grid = [16, 16]
lengths = ["1 mm", "1 mm"]
[patches]
grid = [2, 2]
[micro]
finite_slopes = false
[body]
mesh = "cube.msh"
contact = "top"
supports = [{ surface = "bottom" }]
young_modulus = "4 GPa"
poisson_ratio = 0.15
[coupling]
interface = "pointwise"
[load]
approach = "6 um"
steps = 2
"""
OF_THE_SUITE = (
    "tests/verification/test_releases.py",
    "tests/unit/macro/linear_solvers/test_solver_selection.py",
    "tests/unit/macro/contact/test_first_steps.py",
)
NEWER = ("python3.14", "python3.13", "python3.12")
NO_REGISTRY = ("No matching distribution found", "Could not find a version", "connection")


def newer_python():
    """Return a Python that dolfinx's wheels are made for; None where there is none."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    own = sorted(versions.glob("3.1[234]*/bin/python"))
    for python in [*filter(None, map(shutil.which, NEWER)), *reversed(own)]:
        # commands of pyenv stand for versions that need not be chosen
        words = [python, "-c", "import ensurepip, venv, sys; sys.exit(sys.version_info < (3, 12))"]
        if not subprocess.run(words, capture_output=True, check=False).returncode:
            return python
    return None


@pytest.fixture(scope="module")
def alone(built, bare):
    """Return the folder of the environment, now with dolfinx's wheels, and scenes to run there."""
    if not newer_python():
        pytest.skip("no Python 3.12 or newer")
    words = (f"{built[1]}[fenicsx]", "pytest", "pytest-xdist")
    installed = call(bare / "bin" / "pip", *INSTALL, *words, cwd=bare, check=False)
    if installed.returncode and any(words in installed.stderr for words in NO_REGISTRY):
        pytest.skip("no registry has dolfinx's wheels for this machine")
    assert not installed.returncode, installed.stderr
    for name in ("my_surface.toml", "ground_steel.txt"):
        shutil.copy(ROOT / "demos" / "scenes" / name, bare)
    (bare / "body.toml").write_text(BODY, encoding="utf-8")
    write_box(bare / "cube.msh", 3 * [np.linspace(0.0, 1.0, 7)])
    return bare


def call_alone(folder, *words, **options):
    """Call a command of the environment, its own first on PATH, without the project's on it."""
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return call(*words, cwd=folder, **MPI_ENVIRONMENT, PATH=path, PYTHONPATH="", **options)


def forces(folder):
    with (folder / "history.csv").open(encoding="utf-8") as file:
        return [float(row["force_N"]) for row in csv.DictReader(file)]


def test_with_the_wheels_of_dolfinx_the_doctor_is_content(alone):
    # in its own cache: a compilation that was killed in the user's would be told
    shown = call_alone(alone, "patchlaw", "doctor", XDG_CACHE_HOME=str(alone)).stdout
    assert "MPICH" in shown and "hypre" not in shown
    assert f"{alone / 'bin' / 'mpirun'}" in shown


def test_with_the_wheels_of_dolfinx_the_main_scene_runs(alone):
    call_alone(alone, "patchlaw", "run", "my_surface.toml")
    with (alone / "results" / "my_surface" / "history.csv").open(encoding="utf-8") as file:
        last = list(csv.DictReader(file))[-1]
    assert f"{1e3 * float(last['approach_mm']):.4f}" == "0.6028"  # the README's


@pytest.mark.slow
def test_with_the_wheels_of_dolfinx_bodies_give_the_same_on_two_ranks(alone):
    words = ("run", "body.toml", "--out")
    call_alone(alone, "mpirun", "-n", "2", "patchlaw", *words, "ranks")
    call_alone(alone, "patchlaw", *words, "serial")
    call(sys.executable, "-m", "patchlaw", *words, "here", cwd=alone, PYTHONPATH=str(ROOT))
    here = forces(alone / "here")
    assert len(here) == 2 and here[-1] > 0.1
    for other in ("serial", "ranks"):
        # residuals of 1e-10, with other multigrid methods
        assert forces(alone / other) == pytest.approx(here, rel=1e-8)


@pytest.mark.slow
def test_with_the_wheels_of_dolfinx_a_part_of_the_suite_passes(alone):
    for folder in ("tests", "demos/scenes"):
        kept = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, alone / folder, ignore=kept)
    shutil.copy(ROOT / "pyproject.toml", alone)
    words = ("-q", "-n", "0", *OF_THE_SUITE)
    shown = call_alone(alone, "bin/python", "-P", "-m", "pytest", *words).stdout
    assert " passed" in shown and " failed" not in shown
