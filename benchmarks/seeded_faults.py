"""Faults of one line in the physics: which test finds each, and which are found by none.

    .venv/bin/python benchmarks/seeded_faults.py [--only WORD …] [--whole] [--list]

Each fault is a wrong sign, factor, index, norm or unit in one line, or a term left out. It is made
in a copy of the packages, and the tests named for it are run until the first fails; with `--whole`
all tests follow where those find nothing. A fault is stated by its folder, the text that stands
there once, and what stands there instead: a line that has moved to another module is found, one
that has changed is refused. The tests named must pass on the packages as they are; tests that do
not run, for whatever reason, end the program. Tests of text and style (tests/house) do not count.
The exit code is the number of faults that nothing found.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("geometry", "micro", "macro", "multiscale", "support", "patchlaw")


class Fault(NamedTuple):
    """One line that is wrong: where, what stands there, what instead, and tests to try first."""

    folder: str
    right: str
    wrong: str
    tests: str


FAULTS = [
    # asperities and closed forms
    Fault(
        "micro",
        "= 4.0 / 3.0 * self.contact_modulus",
        "= 3.0 / 4.0 * self.contact_modulus",
        "unit/micro/closed_forms/test_hertz.py",
    ),
    Fault(
        "micro",
        "s * slope - (along + across) / 3.0",
        "s * slope - (along + across) / 2.0",
        "unit/micro/closed_forms/test_hertz.py",
    ),
    Fault(
        "micro",
        "unit = 2.0 / 3.0 * np.pi * self.contact_modulus",
        "unit = 4.0 / 3.0 * np.pi * self.contact_modulus",
        "unit/micro/asperities/test_asperity_model.py",
    ),
    Fault(
        "micro",
        "along, across = cos * x + sin * y, cos * y - sin * x",
        "along, across = cos * x - sin * y, cos * y + sin * x",
        "unit/micro/asperities/test_hertz_pairs.py",
    ),
    Fault(
        "micro",
        "return total / (4.0 * a * b)",
        "return total / (4.0 * a * a)",
        "unit/micro/closed_forms/test_love.py",
    ),
    Fault(
        "micro",
        "return 4.0 * a * b * total",
        "return 4.0 * a * a * total",
        "unit/micro/closed_forms/test_love.py",
    ),
    # the half-space and its contact problem
    Fault(
        "micro",
        "np.divide(2.0, q, out=np.zeros_like(q)",
        "np.divide(1.0, q, out=np.zeros_like(q)",
        "unit/micro/boundary_elements/test_half_space_grid.py",
    ),
    Fault(
        "micro",
        "x, y = ((np.arange(n + 1) - 0.5) * step",
        "x, y = (np.arange(n + 1) * step",
        "unit/micro/boundary_elements/test_half_space_grid.py",
    ),
    Fault(
        "micro",
        "EDGE_EXCESS = (np.pi - 1.0 + np.log(2.0)) / 24.0",
        "EDGE_EXCESS = (np.pi - 1.0 + np.log(2.0)) / 12.0",
        "verification/test_half_space_hertz.py",
    ),
    Fault(
        "micro",
        "energy = 0.5 * float(np.vdot(",
        "energy = float(np.vdot(",
        "unit/multiscale/loading/test_energy.py",
    ),
    Fault(
        "micro",
        "left = anew if depth is None else depth + anew",
        "left = anew",
        "unit/micro/half_space/test_pressure_bound.py unit/multiscale/test_hardness_in_scenes.py",
    ),
    Fault(
        "micro",
        "found.total * float(np.prod(model.surface.spacing))",
        "found.total * float(model.surface.spacing[0]) ** 2",
        "verification/test_friction_rough.py",
    ),
    Fault(
        "micro",
        "(2, 2): -one - steep[0]",
        "(2, 2): -one + steep[0]",
        "unit/micro/half_space/test_stresses_below.py",
    ),
    Fault(
        "micro",
        "-xx + steep[1] - 2.0 * poisson_ratio * yy",
        "-xx + steep[1] + 2.0 * poisson_ratio * yy",
        "unit/micro/half_space/test_stresses_below.py",
    ),
    # free sides, finite bodies, finite slopes
    Fault(
        "micro",
        "((0.5 - nu, numbers), (nu - 0.5, full))",
        "((0.5 + nu, numbers), (-nu - 0.5, full))",
        "unit/micro/boundary_elements/test_side_stresses.py unit/micro/boundary_elements",
    ),
    Fault(
        "micro",
        "direct - (1.0 - 2.0 * poisson_ratio) * of.below",
        "direct - (1.0 - poisson_ratio) * of.below",
        "unit/micro/boundary_elements/test_quarter_space.py",
    ),
    Fault(
        "micro",
        "self._held = nu / (1.0 - nu) if held else 0.0",
        "self._held = nu if held else 0.0",
        "unit/micro/boundary_elements",
    ),
    Fault(
        "micro",
        "yy - nu * xx, (1.0 + nu) * xy]) / modulus",
        "yy - nu * xx, (1.0 - nu) * xy]) / modulus",
        "unit/micro/boundary_elements/test_finite_slopes.py",
    ),
    Fault(
        "micro",
        "total[2, 0], total[2, 1] = beta * modes((1, 0)), beta * modes((0, 1))",
        "total[2, 0], total[2, 1] = beta * modes((0, 1)), beta * modes((1, 0))",
        "unit/micro/boundary_elements/test_traction_modes.py",
    ),
    Fault(
        "micro",
        "ratio * yy, ratio * xy])",
        "ratio * yy, -ratio * xy])",
        "unit/micro/friction/test_tangential_grid.py",
    ),
    # flow, heat
    Fault("micro", "wide * wide * wide", "wide * wide", "unit/micro/flow/test_gap_flow.py"),
    Fault(
        "micro",
        "drop / (12.0 * viscosity)",
        "drop / (6.0 * viscosity)",
        "unit/micro/flow/test_gap_flow.py",
    ),
    Fault(
        "micro",
        "return 2.0 * conductivity / contact_modulus * stiffness / _MM_PER_M",
        "return 2.0 * conductivity / contact_modulus * stiffness",
        "verification/test_conductance.py",
    ),
    # surfaces, materials, planes, springs
    Fault(
        "geometry",
        "(1.0 - self.poisson_ratio**2) / self.young_modulus",
        "(1.0 - self.poisson_ratio) / self.young_modulus",
        "unit/geometry/test_materials.py",
    ),
    Fault(
        "geometry",
        "return (2.0 - poisson_ratio) / (2.0 * (1.0 - poisson_ratio))",
        "return (2.0 - poisson_ratio) / (2.0 * (1.0 + poisson_ratio))",
        "unit/geometry/test_materials.py",
    ),
    Fault(
        "geometry",
        "return 0.25 * along * self.contact_modulus",
        "return 0.5 * along * self.contact_modulus",
        "unit/geometry/test_materials.py unit/micro/friction/test_goodman.py",
    ),
    Fault(
        "geometry",
        "shape = squared ** (-0.5 * (spectrum.hurst + 1.0))",
        "shape = squared ** (-0.5 * (spectrum.hurst + 2.0))",
        "unit/geometry/test_spectrum.py",
    ),
    Fault(
        "geometry",
        "np.pi * (waves.kx / nx + waves.ky / ny)",
        "np.pi * (waves.kx / nx)",
        "unit/geometry/test_spectrum.py",
    ),
    Fault("geometry", "m2=0.5 * (xx + yy)", "m2=xx + yy", "unit/geometry/test_statistics.py"),
    Fault(
        "geometry",
        "self.approach + tx * (x - xc) + ty * (y - yc)",
        "self.approach + tx * (x - xc) + ty * (y - xc)",
        "unit/micro/complementarity/test_free_plane.py",
    ),
    Fault(
        "geometry",
        "square = 0.5 * inside**2 /",
        "square = inside**2 /",
        "unit/geometry/test_spring_bed.py",
    ),
    Fault(
        "geometry",
        "own = (0.5 + 0.5 * then.force / largest)",
        "own = (1.0 + 0.5 * then.force / largest)",
        "unit/geometry/test_sliders.py",
    ),
    Fault(
        "geometry",
        "return ix * self.grid[1] + iy",
        "return ix * self.grid[0] + iy",
        "unit/geometry/test_patches.py",
    ),
    # finite elements
    Fault(
        "macro",
        "(3.0 * first + 2.0 * shear) * self._cell_strain(loads)",
        "(first + 2.0 * shear) * self._cell_strain(loads)",
        "verification/test_body_loads.py unit/macro/test_elasticity.py",
    ),
    Fault(
        "macro",
        "moment + np.cross(self._middle - point, force)",
        "moment - np.cross(self._middle - point, force)",
        "unit/macro/test_elasticity.py",
    ),
    Fault(
        "macro",
        "nu / (1.0 - nu) * (np.eye(len(xx)) / area)",
        "nu * (np.eye(len(xx)) / area)",
        "unit/macro/compliance/test_face_stresses.py",
    ),
    Fault(
        "macro",
        "plane = modulus / (1.0 - nu**2)",
        "plane = modulus / (1.0 - nu)",
        "unit/macro/compliance/test_face_stresses.py",
    ),
    Fault(
        "macro",
        "(mean * length / 8.0)[:, None] * outwards",
        "(mean * length / 4.0)[:, None] * outwards",
        "unit/macro/contact/test_face_flow.py",
    ),
    Fault(
        "macro",
        "depth=own.depth + depth[kept]",
        "depth=own.depth",
        "unit/macro/contact/test_face_pair.py",
    ),
    Fault(
        "macro",
        "rise = -sampling.displacements(moved)",
        "rise = sampling.displacements(moved)",
        "unit/macro/contact/test_face_pair.py",
    ),
    # laws, errors, what a run states
    Fault(
        "multiscale",
        "closure=local - macro_displacement",
        "closure=local + macro_displacement",
        "unit/multiscale/laws/test_consistent.py",
    ),
    Fault(
        "multiscale",
        "closure=approaches - self.compliance * pressure",
        "closure=approaches - 2.0 * self.compliance * pressure",
        "unit/multiscale/laws/test_isolated.py",
    ),
    Fault(
        "multiscale",
        "dpressure=1.5 * root * slopes[1]",
        "dpressure=root * slopes[1]",
        "unit/multiscale/laws/test_patch_law.py unit/multiscale/models",
    ),
    Fault(
        "multiscale",
        "np.sqrt(variance / (1.0 - shares @ shares or 1.0))",
        "np.sqrt(variance)",
        "unit/multiscale/laws/test_representative.py",
    ),
    Fault(
        "multiscale",
        "work = 0.5 * float((load + ahead) @ motion)",
        "work = float(load @ motion)",
        "unit/multiscale/loading/test_energy.py",
    ),
    Fault(
        "multiscale",
        "error = np.maximum(_HALF * change",
        "error = 0.1 * np.maximum(_HALF * change",
        "verification/test_leak.py unit/multiscale/test_leak_in_scenes.py",
    ),
]


def place(fault: Fault, root: Path) -> Path:
    """Return the module that has the line; raise where none has it, or more than one place."""
    found = [
        path for path in sorted((root / fault.folder).rglob("*.py"))
        for _ in range(path.read_text(encoding="utf-8").count(fault.right))
    ]  # fmt: skip
    if len(found) != 1:
        raise SystemExit(f"{fault.folder}: {fault.right!r} stands {len(found)} times, not once")
    return found[0]


def copied(folder: Path) -> Path:
    """Copy the packages as they are installed, and the tests; return the copy's root."""
    for name in (*PACKAGES, "tests", "benchmarks", "demos"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "docs"):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / name)
    for name in PACKAGES[:-1]:
        (folder / "patchlaw" / name).symlink_to(folder / name)
    return folder


def rewrite(module: Path, text: str) -> None:
    """Write a module; what is compiled of another text of the same length and second goes."""
    module.write_text(text, encoding="utf-8")
    Path(cache_from_source(str(module))).unlink(missing_ok=True)


def first_failure(root: Path, tests: str) -> str | None:
    """Run tests in a copy until one fails; return its name. Raise where they cannot be run."""
    words = ["-n", "0", "-x", "-q", "-p", "no:cacheprovider", "--deselect", "tests/house"]
    paths = [f"tests/{test}" for test in tests.split() or [""]]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words, *paths],
        cwd=root, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(root)},
    )  # fmt: skip
    if done.returncode == 0:
        return None
    found = re.search(r"^(?:FAILED|ERROR) (\S.*?)(?: - |$)", done.stdout, re.MULTILINE)
    if done.returncode != 1 or not found:  # not collected, for example
        told = (done.stdout + done.stderr)[-2000:]
        raise SystemExit(f"{' '.join(paths)}: pytest ends with {done.returncode}\n{told}")
    return found[1]


@cache
def must_pass(root: Path, tests: str) -> None:
    """Raise where tests fail without a fault, and would seem to find any; run them once."""
    if failed := first_failure(root, tests):
        raise SystemExit(f"{failed} fails without a fault")


def main() -> int:
    """Seed the faults one by one; print a line for each."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="*", default=[], help="words of which a fault has one")
    parser.add_argument("--whole", action="store_true", help="all tests where the named find none")
    parser.add_argument("--list", action="store_true", help="print where each line stands")
    choice = parser.parse_args()
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        root = None if choice.list else copied(Path(folder))
        for number, fault in enumerate(FAULTS, 1):
            if choice.only and not any(word in " ".join(fault) for word in choice.only):
                continue
            module = place(fault, ROOT)
            where = f"{number:2} {module.relative_to(ROOT)}: {fault.right} → {fault.wrong}"
            if root is None:
                print(where)
                continue
            copy, text = root / module.relative_to(ROOT), module.read_text("utf-8")
            found, began = None, time.time()
            for tests in [fault.tests, *[""] * choice.whole]:  # the named ones, then all
                if found is None:
                    must_pass(root, tests)
                    rewrite(copy, text.replace(fault.right, fault.wrong))
                    found = first_failure(root, tests)
                    rewrite(copy, text)
            missed += found is None
            print(
                f"{where}\n   {found or 'FOUND BY NONE'} ({time.time() - began:.0f} s)", flush=True
            )
    print(f"{missed} found by none")
    return missed


if __name__ == "__main__":
    sys.exit(main())
