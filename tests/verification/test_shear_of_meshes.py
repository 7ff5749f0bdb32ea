"""Shear of blocks and of bodies on meshes: against finite elements, blocks and each other."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from helpers.block_cases import block_of
from helpers.box_msh import cube_section

from patchlaw.geometry import BlockShape, Material, MaterialPair
from patchlaw.macro import compat
from patchlaw.micro import FrictionModel
from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

CONSTANTS = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
SPECTRUM = {"hurst": 0.95, "waves": [2, 5], "rms_slope": 0.215, "seed": 1}
SCENE = {
    "surface": {"spectrum": {**SPECTRUM, "waves": [2, 10]}, "grid": [64, 64], "lengths": [1, 1]},
    "coupling": {"kind": "concurrent"},
    "micro": {"finite_slopes": False},
    "output": {"figures": False, "report": False, "check": "none"},
}
TURN = {"force": 2.0, "steps": 1, "shear": [[1e-3, 0.0], [1e-3, 8e-4]], "shear_steps": 1}


def sheared(*, coupled=False, **sections):
    """Return shear forces and approach of the last load steps, shape (2, 3) [N, µm]."""
    friction = {"coefficient": 0.4, "coupled": coupled}
    history = run(Scene.from_dict(SCENE | {"friction": friction, "load": TURN} | sections))
    rows = [(s.shear_force_x_N, s.shear_force_y_N, 1e3 * s.approach_mm) for s in history.steps]
    return np.array(rows[1:])


def cube(folder, cells, **where):
    return CONSTANTS | cube_section(folder, cells, **where)


@pytest.mark.slow
@pytest.mark.parametrize("coupled", [False, True])
def test_a_cube_on_a_mesh_is_the_block(tmp_path, coupled):
    """Its own shear is more than a third of the shift."""
    found = sheared(body=cube(tmp_path, 6), coupled=coupled)
    expected = sheared(block=CONSTANTS, coupled=coupled)
    alone = sheared(block=CONSTANTS, coupling={"kind": "analytic"})
    largest = np.abs(expected[:, :2]).max()
    # 6³ quadratic hexahedra are 0.3 % too stiff in shear, as their edges at the support are
    # singular; coupled, more than half of the force is what pressures of the whole face do
    atol = (0.016 if coupled else 0.008) * largest
    np.testing.assert_allclose(found[:, :2], expected[:, :2], atol=atol)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], rtol=1e-3)
    assert np.abs(alone[0, 0] / expected[0, 0]) > 1.4


@pytest.mark.slow
def test_a_meshed_counter_body_goes_with_a_margin(tmp_path):
    wide = CONSTANTS | {"margin": 0.2}
    counter = cube(tmp_path, 7, margin=0.2, above=True)
    found = sheared(block=wide, counter_body=counter)
    softer = sheared(block=wide | {"young_modulus": 2000.0})
    # that of the mesh, one half of the compliance
    np.testing.assert_allclose(found, softer, atol=0.004 * np.abs(softer[:, :2]).max())


@pytest.mark.slow
@pytest.mark.parametrize("cells", [2, 4])
def test_stated_errors_know_the_elements(tmp_path, cells):
    """Edges at the support are singular: force and shear of few cells against the block's."""
    coarse = {**SCENE["surface"], "grid": [32, 32], "spectrum": SPECTRUM}
    load = {"approach": 8e-3, "steps": 1, "shear": [[1e-3, 4e-4]], "shear_steps": 1}
    scene = SCENE | {"surface": coarse, "friction": {"coefficient": 0.4}, "load": load}
    quiet = {**SCENE["output"], "contact": "none"}
    body = {"body": cube(tmp_path, cells), "output": {**quiet, "check": "last"}}
    found = run(Scene.from_dict(scene | body)).steps[-1]
    true = run(Scene.from_dict(scene | {"block": CONSTANTS, "output": quiet})).steps[-1]
    shear, other = (
        np.array([step.shear_force_x_N, step.shear_force_y_N]) for step in (found, true)
    )
    by_body = dict(found.errors)["body"]
    of_shear = dict(found.shear_errors)["body"] + by_body / found.force_N * np.hypot(*shear)
    assert abs(found.force_N - true.force_N) < 1.5 * by_body
    assert 1e-3 < np.hypot(*(shear - other)) / np.hypot(*other) < 1.5 * of_shear / np.hypot(*other)


NU, CELLS, HEIGHT = 0.3, 32, 0.8
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=NU)
PARTS = {"inside": ((0.25, 0.5), (0.25, 0.75)), "at a corner": ((0.5, 1.0), (0.75, 1.0))}


def by_elements(part, sides, n):
    """Return mean displacements of a part of the top by unit tractions on it, shape (3, 3)."""
    block = block_of(sides, MATERIAL.young_modulus, NU, height=HEIGHT, cells=(n, n, n))
    space = block.space
    (x0, x1), (y0, y1) = part
    slack = 1e-9

    def inside(x):
        along = (x[0] > x0 - slack) & (x[0] < x1 + slack) & (x[1] > y0 - slack)
        return along & (x[1] < y1 + slack) & np.isclose(x[2], 0.0)

    facets = np.sort(mesh.locate_entities_boundary(space.mesh, 2, inside))
    tags = mesh.meshtags(space.mesh, 2, facets, np.ones(len(facets), np.int32))
    area = ufl.Measure("ds", space.mesh, subdomain_data=tags)(1)
    test, held = ufl.TestFunction(space), ~block.free.array_r.astype(bool)
    rows = []
    for axis, sign in enumerate((1.0, 1.0, -1.0)):
        direction = ufl.as_vector([sign * (axis == k) for k in range(3)])
        load = compat.assemble_vector(compat.compile_form(ufl.dot(direction, test) * area))
        load.array[held] = 0.0
        moved = block.solve(load)
        means = [
            fem.assemble_scalar(compat.compile_form(sign * moved[k] * area))
            for k, sign in enumerate((1.0, 1.0, -1.0))
        ]
        rows.append(np.array(means) / ((x1 - x0) * (y1 - y0)))
    return np.array(rows).T


def by_modes(part, sides):
    """Return the same by cells and modes; downwards by pressures is left 0."""
    shape = BlockShape(interface=(1.0, 1.0), height=HEIGHT, cells=(8, 8, 8))
    body = FaceTerms((block_term(shape, MATERIAL, sides),)).traction_term(None)
    pair, spacing = MaterialPair(first=MATERIAL), (1.0 / CELLS, 1.0 / CELLS)
    model = FrictionModel(materials=pair, coefficient=0.3, spacing=spacing, body=body)
    grid = model.grid((slice(0, CELLS), slice(0, CELLS)))
    cross = model.cross((CELLS, CELLS))
    middle = (np.arange(CELLS) + 0.5) / CELLS
    along_x, along_y = ((low < middle) & (middle < high) for low, high in part)
    loaded, found = along_x[:, None] & along_y, np.zeros((3, 3))
    for axis in range(2):
        traction = np.zeros((2, CELLS, CELLS))
        traction[axis] = loaded
        moved = grid.displacement(traction)
        found[:2, axis] = moved[:, loaded].mean(axis=1)
        found[2, axis] = cross.across(traction)[loaded].mean()
    found[:2, 2] = cross.sideways(1.0 * loaded)[:, loaded].mean(axis=1)
    return found


FREE, ROLLER = zip(PARTS.values(), ("free", "roller"), strict=True)


@pytest.mark.slow
@pytest.mark.parametrize(("part", "sides"), [FREE, ROLLER])
def test_tractions_displace_a_block_as_finite_elements_say(part, sides):
    middle, fine = (by_elements(part, sides, n) for n in (8, 16))
    # the loads jump, so that the mesh errs by less than h²; of 24 elements the same remains
    expected = fine + (fine - middle) / (2.0**1.5 - 1.0)
    found = by_modes(part, sides)
    expected[2, 2] = 0.0
    # what the extrapolation leaves was 0.004 of the largest displacement
    np.testing.assert_allclose(found, expected, atol=0.008 * np.abs(expected).max())
    half_space = by_modes_of_half_space(part)
    assert abs(found[0, 0] / half_space - 1.0) > 0.2  # the body matters


def by_modes_of_half_space(part):
    pair, spacing = MaterialPair(first=MATERIAL), (1.0 / CELLS, 1.0 / CELLS)
    model = FrictionModel(materials=pair, coefficient=0.3, spacing=spacing)
    middle = (np.arange(CELLS) + 0.5) / CELLS
    along_x, along_y = ((low < middle) & (middle < high) for low, high in part)
    loaded = along_x[:, None] & along_y
    traction = np.stack([1.0 * loaded, 0.0 * loaded])
    return model.grid((slice(0, CELLS), slice(0, CELLS))).displacement(traction)[0, loaded].mean()
