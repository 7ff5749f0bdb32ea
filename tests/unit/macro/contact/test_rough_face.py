"""Rough faces of any body against the top of a block on the same mesh."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw import InputError
from patchlaw.geometry import BlockShape, Control, Spectrum, synthesise
from patchlaw.macro import (
    BOTTOM,
    TOP,
    Block,
    Material,
    MeshedBody,
    RoughFace,
    Support,
    TaggedMesh,
    UnilateralContactProblem,
    nodal_contact,
    rough_block_mesh,
)

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.15, seed=2), grid=(64, 64), lengths=(1.0, 0.8)
)
SHAPE = BlockShape(interface=(1.0, 0.8), height=1.0, cells=(10, 8, 4), grading=3.0)
HIGHEST = SURFACE.highest - SURFACE.mean_height
CONTROL = Control(force=3.0, tilt=None)


def body(down=0.0):
    """Return the rough block as a body of any shape."""
    block, _ = rough_block_mesh(SHAPE, SURFACE, MPI.COMM_SELF)
    mesh = TaggedMesh(mesh=block.mesh, facet_tags=block.facet_tags)
    return MeshedBody(mesh, MATERIAL, [Support(tag=BOTTOM, displacement=(0.0, 0.0, -down))])


@cache
def of_the_block(method):
    mesh, _ = rough_block_mesh(SHAPE, SURFACE, MPI.COMM_SELF)
    problem = UnilateralContactProblem(Block(mesh, MATERIAL), HIGHEST, method=method)
    return problem, problem.solve(CONTROL)


@pytest.mark.parametrize(
    "method", ["active-set", pytest.param("augmented-lagrangian", marks=pytest.mark.long)]
)
def test_a_body_gives_the_contact_of_the_block(method):
    problem, expected = of_the_block(method)
    face = RoughFace(body(), TOP, (1.0, 0.8))
    assert face.modulus == pytest.approx(MATERIAL.contact_modulus, rel=1e-14)
    other = UnilateralContactProblem(face, HIGHEST, method=method)
    found = other.solve(CONTROL)
    assert found.nodes == expected.nodes
    for name in ("approach", "tilt", "force", "reaction", "contact_area", "mean_separation"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-9), name
    one, two = nodal_contact(problem, expected), nodal_contact(other, found)
    np.testing.assert_allclose(two.force, one.force, atol=1e-9 * one.force.max())
    np.testing.assert_allclose(two.x, one.x, atol=1e-12)


def test_a_body_that_its_supports_have_lowered_is_approached_later():
    _, expected = of_the_block("active-set")
    face = RoughFace(body(down=2e-3), TOP, (1.0, 0.8))
    found = UnilateralContactProblem(face, HIGHEST).solve(CONTROL)
    assert found.approach == pytest.approx(expected.approach + 2e-3, rel=1e-8)
    assert found.force == pytest.approx(expected.force, rel=1e-8)
    np.testing.assert_allclose(found.nodal.gap, expected.nodal.gap, atol=1e-10)


@pytest.mark.slow
def test_other_faces_are_refused():
    with pytest.raises(InputError, match="no facet of the body has this marker"):
        UnilateralContactProblem(RoughFace(body(), 77, (1.0, 0.8)), HIGHEST)
