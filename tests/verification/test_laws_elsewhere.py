"""Other finite elements press a block through ``laws.csv``, with the scripts of demos/elsewhere.

GetFEM and SfePy come from Debian (python3-getfem, python3-sfepy), FElupe and FourCIPP from PyPI
(``pip install --target FOLDER felupe fourcipp``, the folder last in PYTHONPATH).
"""

import os
import subprocess
import sys
import textwrap
import tomllib

import numpy as np
import pytest
from helpers.block_cases import block_of
from helpers.small_scene import SMALL_SCENE

from patchlaw.geometry import Control
from patchlaw.macro import LawContactProblem, LoadedFace
from patchlaw.multiscale import Run, Scene, export_laws


class Lines:
    """Straight lines through rows, without pressure before the first and on beyond the last."""

    def __init__(self, closure, pressure):
        self._closure, self._pressure = closure, pressure
        self._slope = np.diff(pressure) / np.diff(closure)

    def _row(self, closure):
        return np.clip(np.searchsorted(self._closure, closure) - 1, 0, len(self._slope) - 1)

    def pressure(self, closure):
        row = self._row(closure)
        line = self._pressure[row] + self._slope[row] * (closure - self._closure[row])
        return np.where(closure > self._closure[0], line, 0.0)

    def stiffness(self, closure):
        return np.where(closure > self._closure[0], self._slope[self._row(closure)], 0.0)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """Return the folder of the exported law, our forces on the scripts' block, and the table."""
    scene = tomllib.loads(SMALL_SCENE)
    scene["coupling"]["kind"] = "isolated"
    scene["patches"]["grid"] = [1, 1]
    scene["load"]["approach"] = "10 um"
    table = Run(Scene.from_dict(scene)).make_laws()
    folder = tmp_path_factory.mktemp("law")
    export_laws(table, folder, "csv")
    block = block_of(element="Q1", cells=(6, 6, 4), young_modulus=4000.0, poisson_ratio=0.3)
    face = LoadedFace.of_block(block, table.patches)
    problem = LawContactProblem(face, table.laws, "pointwise")
    # within the rows, beyond the last, and open
    forces = {at: problem.solve(Control(approach=at)).force for at in (8e-3, 2e-2, -1e-3)}
    rows = np.genfromtxt(folder / "laws.csv", delimiter=",", names=True)
    lines = Lines(rows["closure_mm"], rows["pressure_MPa"])
    beyond = LawContactProblem(face, [lines], "pointwise").solve(Control(approach=2e-2))
    assert beyond.sample_closure.max() > 1.3 * rows["closure_mm"][-1]
    return folder, forces | {2e-2: beyond.force}, table


@pytest.mark.parametrize(
    "program", ["felupe", "getfem", pytest.param("sfepy", marks=pytest.mark.slow)]
)
def test_a_block_of_another_program_has_our_force(root, pressed, program):
    folder, forces, _ = pressed
    known = subprocess.run([sys.executable, "-c", f"import {program}"], capture_output=True)
    if known.returncode:
        pytest.skip(f"{program} is not installed")
    for approach, force in forces.items():
        done = subprocess.run(
            [sys.executable, root / f"demos/elsewhere/{program}_block.py", str(approach)],
            cwd=folder,
            env=dict(os.environ),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        (line,) = [one for one in done.stdout.splitlines() if one.startswith("force ")]
        # straight lines between the rows err by 1e-4 of the pressure
        assert float(line.split()[1]) == pytest.approx(force, rel=1.1e-4, abs=1e-12)


def test_the_section_that_modules_for_4c_state_is_valid_in_its_schema(pressed, tmp_path):
    """FourCIPP holds the schema of 4C's input (2026.4.0-dev with FourCIPP 1.166.0)."""
    given = pytest.importorskip("fourcipp.fourc_input", reason="FourCIPP is not installed")
    _, _, table = pressed
    texts = [path.read_text() for path in export_laws(table, tmp_path, "4c")]
    (section,) = [text[text.index("    CONTACT") : text.index("Units")] for text in texts]
    file = tmp_path / "laws.4C.yaml"
    file.write_text(textwrap.dedent(section))
    laws = given.FourCInput.from_4C_yaml(file)
    assert laws.validate(sections_only=True)
    (law,) = laws["CONTACT CONSTITUTIVE LAWS"]
    law["CoConstLaw_python_surrogate"]["File"] = "law.py"  # which there is not
    with pytest.raises(Exception, match="CoConstLaw_python_surrogate"):
        laws.validate(sections_only=True)
