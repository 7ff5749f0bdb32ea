"""What others say and what we find: the numbers of docs/witnesses.md, a line each.

`.venv/bin/python benchmarks/witnesses.py` takes two minutes; the words `closed-forms`,
`waves`, `other-codes`, `finite-elements` and `other-programs` choose parts of it. GetFEM and
CalculiX are left out where they are not installed. The code is that of the tests.
"""

import sys
import tempfile
from importlib import import_module
from pathlib import Path

import numpy as np

from patchlaw.geometry import Control

FOLDERS = ("verification", "unit/micro", "unit/micro/boundary_elements", "unit/multiscale", "")
sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / folder) for folder in FOLDERS]


def modules(names):
    """Return the test modules of these names."""
    return [import_module(f"test_{name}") for name in names.split()]


def closed_forms():
    """Yield closed forms of one contact beside the half-space model."""
    hertz, waves, spots = modules("half_space_hertz half_space_closed_forms conductance")
    state, exact = hertz.sphere(256, hertz.OFFSETS[0])
    yield "Hertz, sphere: force [N]", float(exact.force), state.force
    yield "its contact area [mm²]", float(exact.area), state.contact_area
    yield "its largest pressure [MPa]", float(exact.peak_pressure), float(state.pressure.max())
    surface = hertz.paraboloid((120, 60), (0.5, 0.25), (3.0, 0.4))
    state = hertz.HalfSpaceModel(surface, contact_modulus=hertz.E_STAR).press(
        Control(approach=0.01)
    )
    yield "Hertz, ellipsoid: force [N]", float(hertz.hertz(3.0, 0.4, 0.01).force), state.force
    punch = 2.0 * waves.punch(128) - waves.punch(64)
    yield "square punch: F / E* δ L", waves.SQUARE_PUNCH, punch
    x = (np.arange(256) + 0.5) / 256 - 0.5
    sphere = waves.Surface(heights=-(x[:, None] ** 2 + x**2) / 10.0, lengths=(1.0, 1.0))
    model = waves.HalfSpaceModel(sphere, contact_modulus=spots.MODULUS)
    stiffness = model.stiffness(model.press(Control(approach=2e-2))).approach
    found = spots.total_conductance(stiffness, spots.MODULUS, spots.pair_conductivity([40.0]))
    yield "conductance of a spot, 4 k a [W/K]", 4e-3 * 40.0 * np.sqrt(0.1), found


def waves_and_sides():
    """Yield closed forms of wavy surfaces and of a free side."""
    waves, laws, quarter = modules("half_space_closed_forms representative_laws quarter_space")
    wave = waves.wave((256, 5), (1.0, 0.3), 0.01)
    model = waves.HalfSpaceModel(wave, contact_modulus=1.0, periodic=True)
    state = model.press(Control(force=0.5 * waves.FULL * 0.3))
    area = state.in_contact.mean()
    yield "Westergaard, half of full pressure: contact", waves.wet(0.5), area
    exact = waves.westergaard(wave.x, 0.5)[0]
    yield "its pressure at the crest / E*", float(exact), float(state.pressure[0, 0])
    energy = model.press(Control(force=waves.FULL * 0.3)).elastic_energy / wave.area
    yield "energy of the flattened wave / E* [mm]", 0.25 * waves.FULL * 0.01, energy
    x = np.cos(2.0 * np.pi * (np.arange(128) + 0.5) / 128)
    surface = waves.Surface(heights=0.01 * np.outer(x, x), lengths=(1.0, 1.0), periodic=True)
    law = laws.representative_law([surface], 1.0, largest_closure=0.015)
    (closed,) = np.flatnonzero(law.rows.closure == law.initial_separation)
    full = np.sqrt(2.0) * np.pi * 0.01
    yield "crossed waves: pressure of full contact / E*", full, float(law.rows.pressure[closed])
    table = quarter.side_compliance(0.15, np.array([1e-4, 1e-3]), 1.0)
    slope = float(table[0, 0] - table[1, 1]) / np.log(10.0)
    wedge = 0.5 / (np.pi / 4 - 0.5) + 0.5 / (np.pi / 4 + 0.5) - 2.0 / np.pi
    yield "wedge: compliance of a free side", wedge, slope


def other_codes():
    """Yield MIRCO, GFMD and ContactMechanics beside the half-space model on the same cells."""
    mirco, gfmd, peer, plastic = modules("mirco gfmd half_space_peer hardness_peer")
    for name, case in (("sup7", mirco.SUP7), ("sup9", mirco.SUP9)):
        pressure, area = mirco.pressed(case)
        yield f"MIRCO, {name}: pressure", case.pressure, pressure
        yield f"MIRCO, {name}: contact", case.area_fraction, area
    for cells, factor in mirco.SHAPE_FACTORS.items():
        yield f"MIRCO, flat punch of {cells}² cells", factor, mirco.shape_factor(cells)
    for name, column, periodic in (("half-space", 1, False), ("periodic", 2, True)):
        table, rough = np.loadtxt(peer.TABLE, delimiter=","), peer.surface()
        model = peer.HalfSpaceModel(rough, contact_modulus=peer.E_STAR, periodic=periodic)
        row = table[np.isclose(table[:, 0], 8e-3)][0]
        yield (
            f"ContactMechanics, {name}: force [N]",
            row[column],
            model.press(Control(approach=row[0])).force,
        )
    seed, approach, hardness, force, _ = plastic.TABLE[2]
    rough, options = plastic.surface(int(seed)), {"hardness": hardness, "tolerance": 1e-10}
    model = plastic.HalfSpaceModel(rough, contact_modulus=plastic.E_STAR, **options)
    yield (
        "ContactMechanics, hardness 100 MPa: force [N]",
        force,
        model.press(Control(approach=approach)).force,
    )
    counted, corrected, energy = gfmd.found(gfmd.surface(3.45, 1176, seed=1), gfmd.PRESSURES)
    for i, pressure in enumerate(gfmd.PRESSURES):
        yield f"GFMD, {pressure:g} E*: contact", gfmd.AREAS[i], counted[i]
        yield "the same, corrected by the perimeter", gfmd.AREAS[i], corrected[i]
        yield "its elastic energy / E* [m]", gfmd.ENERGIES[i], energy[i]


def finite_elements():
    """Yield Hertz and Sneddon beside meshed bodies, and Greenwood & Tripp beside laws."""
    meshed, rough = modules("reference_hertz rough_sphere")
    coarse, fine = (meshed.sphere("P2", "active-set", edges)[1].force for edges in (1.5, 3.0))
    exact = float(meshed.CONTACT.force)
    yield "Hertz, meshed, extrapolated: force [N]", exact, fine - (coarse - fine) / 7.0
    yield "the finer mesh alone", exact, fine
    block, _, force, _ = meshed.towards_a_punch(6, 1e-4)
    yield (
        "Sneddon, z ∝ r⁶, meshed: force [N]",
        force,
        block.solve(meshed.Control(approach=1e-4)).force,
    )
    for alpha in (0.05, 0.5, 5.0):
        exact = rough.rough_sphere(4.0, alpha, rough.GAUSSIAN)
        found, rings = rough.forces_on_strips(4.0, alpha, rough.GAUSSIAN, cells=25, beyond=2.5)
        wide, narrow = (line.sum() / line[12] for line in (found, rings))
        radius = exact.radius * wide / narrow
        yield f"Greenwood & Tripp, μ = 4, α = {alpha:g}: a*/a₀", exact.radius, radius


def other_programs():
    """Yield GetFEM and CalculiX beside our finite elements, where they are installed."""
    getfem = import_module("test_rough_getfem")
    if getfem.MISSING:
        print(getfem.MISSING, file=sys.stderr)
    else:
        top = getfem.SURFACE.highest - getfem.SURFACE.mean_height
        for kind, shape in getfem.SHAPES.items():
            mesh, _ = getfem.rough_block_mesh(shape, getfem.SURFACE, getfem.MPI.COMM_SELF)
            block = getfem.Block(mesh, getfem.MATERIAL)
            problem = getfem.UnilateralContactProblem(block, top)
            ours = problem.solve(getfem.Control(approach=getfem.APPROACH))
            forces = getfem.independent(mesh.mesh, kind, f"{top - getfem.APPROACH:.17g}")
            yield f"GetFEM, {kind}: force [N]", forces.sum(), ours.force
    ccx = import_module("test_calculix")
    if ccx.calculix.PROGRAM is None:
        return
    with tempfile.TemporaryDirectory() as name:
        table, path, lines = ccx.exported_laws((1, 1), Path(name))
        for tilt, control in ccx.CONTROLS.items():
            face, _ = ccx.faces_of(table, "Q1", (6, 6, 4))
            found = ccx.calculix.solve(Path(name), face, path, control).force
            yield (
                f"CalculiX, {tilt}, its lines: force",
                found,
                ccx.pressed(face, lines, control).force,
            )
            yield "the same, our law", found, ccx.pressed(face, table.laws, control).force


def difference(theirs, ours):
    """Return how far two numbers are apart, over the first."""
    apart = ours / theirs - 1.0
    return f"{apart:+.2%}" if abs(apart) >= 1e-4 else f"{apart:+.0e}"


if __name__ == "__main__":
    parts = {
        "closed-forms": closed_forms,
        "waves": waves_and_sides,
        "other-codes": other_codes,
        "finite-elements": finite_elements,
        "other-programs": other_programs,
    }
    for part in sys.argv[1:] or parts:
        for what, theirs, ours in parts[part]():
            digits = 10 if abs(ours - theirs) < 1e-5 * abs(theirs) else 5
            numbers = " | ".join(f"{number:.{digits}g}" for number in (theirs, ours))
            print(f"| {what} | {numbers} | {difference(theirs, ours)} |", flush=True)
