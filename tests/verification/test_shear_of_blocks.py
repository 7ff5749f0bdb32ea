"""Blocks under uniform tractions on a part of their top: modes on cells against finite elements.

Trilinear elements on three meshes, extrapolated: 8 and 16 elements a side are 7 and 2.5 % too
stiff. What is compared are mean displacements of the loaded part in three directions by tractions
in three directions, of which the modes have all but downwards by pressures.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from helpers.block_cases import block_of

from patchlaw.geometry import BlockShape, Material, MaterialPair
from patchlaw.macro import compat
from patchlaw.micro import FrictionModel
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

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
