"""What lies in the working folder configures nothing: numbers, figures and files are the same."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.mpi_environment import BESIDE_OTHERS

SCENE = """
[surface]
spectrum = { hurst = 0.95, waves = [2, 3], rms_slope = 0.1, seed = 1 }
grid = [8, 8]
lengths = ["1 mm", "1 mm"]
[block]
young_modulus = "4000 N/mm^2"
poisson_ratio = 0.15
height = "1 mm"
cells = [4, 4, 3]
[patches]
grid = [1, 1]
[micro]
model = "half-space"
[coupling]
kind = "consistent"
interface = "pointwise"
[load]
approach = "8 um"
steps = 2
[output]
figures = "svg"
report = false
fields = "last"
"""
JIT = {"cache_dir": "forms", "cffi_extra_compile_args": ["-O0"], "timeout": 1}
CONFIGURATION = {
    ".petscrc": "-patchlaw_ksp_rtol 0.3\n-log_view :petsc.log\n",
    "petscrc": "-patchlaw_pc_type jacobi\n", "petsc.cfg": "PETSC_ARCH = ../lib\n",
    "dolfinx_jit_parameters.json": json.dumps(JIT), "dolfinx_jit_options.json": json.dumps(JIT),
    "ffcx_parameters.json": "no JSON", "ffcx_options.json": "no JSON",
    "matplotlibrc": "font.size: 30\naxes.facecolor: red\n", "ucx.conf": "UCX_LOG_FILE=ucx.log\n",
    "pybuilddir.txt": "elsewhere\n", "setup.cfg": "[build_ext]\ndebug = 1\n",
}  # fmt: skip
"""Files that libraries read in the working folder, with options that do no harm."""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Return a function that runs the scene in a folder with some files; returns its results."""
    home = tmp_path_factory.mktemp("home")
    (home / "scene.toml").write_text(SCENE, encoding="utf-8")

    def run(files, *words):
        folder = tmp_path_factory.mktemp("folder")
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        out = tmp_path_factory.mktemp("out")
        script = os.path.join(os.path.dirname(sys.executable), "patchlaw")
        done = subprocess.run(
            [script, "run", home / "scene.toml", "--out", out, *words],
            cwd=folder, capture_output=True, text=True, timeout=240, check=False,
            env={"XDG_CACHE_HOME": str(Path.home() / ".cache"), **os.environ, **BESIDE_OTHERS,
                 "HOME": str(home), "PATCHLAW_CACHE": "off"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert sorted(os.listdir(folder)) == sorted(files)  # nothing is written there
        with (out / "history.csv").open(encoding="utf-8") as file:
            rows = [{**row, "wall_s": ""} for row in csv.DictReader(file)]
        pictures = {path.name: path.read_bytes() for path in out.glob("*.svg")}
        return rows, pictures, done.stdout

    return run


@pytest.fixture(scope="module")
def ways(results):
    """Return what is found with configuration, and without."""
    return results(CONFIGURATION)[:2], results({})[:2]


@pytest.mark.long
def test_configuration_in_the_working_folder_is_not_read(ways):
    configured, plain = ways
    assert len(plain[1]) > 3
    assert configured == plain


@pytest.mark.long
def test_options_of_the_command_line_are(results, ways):
    """They may name a file of the working folder, as PETSc's own do."""
    plain, _ = ways[1]
    rows, _, told = results(
        {**CONFIGURATION, "mine": "-patchlaw_ksp_rtol 1e-13\n-log_view\n"},
        "--", "-options_file", "mine",
    )  # fmt: skip
    iterations = [[int(row["linear_iterations"]) for row in of] for of in (plain, rows)]
    assert iterations[1] > iterations[0] and "KSPSolve" in told
