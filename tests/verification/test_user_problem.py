"""Rough interfaces in problems that a user writes in dolfinx, against blocks and closed forms."""

import tomllib

import numpy as np
import pytest
import ufl
from dolfinx import fem
from helpers.block_cases import block_of
from helpers.contact_laws import PowerLaw
from helpers.faces import at
from helpers.laws_on_mesh import lay_on_mesh
from helpers.plane_problems import rollers
from helpers.small_scene import SMALL_SCENE
from helpers.user_problems import (
    BOTTOM,
    HEXAHEDRA,
    LAWS,
    PATCHES,
    TETRAHEDRA,
    TOP,
    box,
    clamped,
    elastic,
    marked,
    pressed_face,
)
from petsc4py import PETSc
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from patchlaw.geometry import Control, RigidPlane
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import ContactProblem, Interface, LawContactProblem, LoadedFace, compat
from patchlaw.multiscale import Run, Scene, run

EXACT = {"ksp_rtol": 1e-13, "snes_rtol": 1e-13}
TILTED = RigidPlane(approach=8e-3, tilt=(2e-3, -1e-3), centre=(0.5, 0.5))
LAW = PowerLaw(3e3)


@pytest.mark.slow
@pytest.mark.parametrize("element", ["P1", "P2", "Q1", "Q2"])
@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
def test_the_papers_cube_as_user_code_is_the_block(element, mode):
    block = block_of(cells=(4, 4, 3), element=element)
    problem = LawContactProblem(LoadedFace.of_block(block, PATCHES), LAWS, mode)
    space = compat.vector_space(block.mesh.mesh, int(element[1]))
    rough, user = pressed_face(
        space, None, at(space.mesh, 2, 0.0), laws=LAWS, patches=PATCHES, mode=mode,
        indenter=TILTED, work=lambda u: elastic(u, degree=block.quadrature_degree),
        held=[clamped(space, None, tag=at(space.mesh, 2, -1.0))],
    )  # fmt: skip
    for control in (Control(approach=8e-3, tilt=(2e-3, -1e-3)), Control(force=6.0, tilt=None)):
        if control.approach is None:
            rough.indenter = control
        assert 0 < user.solve() < 8
        state = problem.solve(control)
        assert rough.force == pytest.approx(state.force, rel=1e-10)
        np.testing.assert_allclose(
            rough.patch_pressure, state.patch_pressure, rtol=1e-8, atol=1e-10
        )
        np.testing.assert_allclose(rough.patch_closure, state.patch_closure, rtol=1e-8)
        assert rough.plane.approach == pytest.approx(state.approach, rel=1e-9)
        np.testing.assert_allclose(rough.plane.tilt, state.tilt, rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(rough.moment, state.moment, atol=1e-9)
        assert user.reaction()[2] == pytest.approx(rough.force, rel=1e-8)


@pytest.mark.long
def test_a_law_table_gives_the_force_of_its_scene(monkeypatch):
    """The small scene's block and patch laws, as user code that reads the table."""
    scene = Scene.from_dict(tomllib.loads(SMALL_SCENE)).with_(
        {
            "coupling": {"kind": "isolated"},
            "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15, "cells": [4, 8, 3]},
        }
    )
    lay_on_mesh(monkeypatch)
    table, history = Run(scene).make_laws(), run(scene)
    mesh = block_of(cells=(4, 8, 3)).mesh
    space = compat.vector_space(mesh.mesh, 1)
    rough, problem = pressed_face(
        space, mesh.facet_tags, 2, laws=table, indenter=RigidPlane(approach=4e-3),
        work=lambda u: elastic(u, degree=2), held=[clamped(space, mesh.facet_tags, tag=1)],
    )  # fmt: skip
    for step in history:
        rough.indenter = RigidPlane(approach=step.approach_mm)
        problem.solve()
        assert rough.force == pytest.approx(step.force_N, rel=1e-9)
        assert rough.area == pytest.approx(step.contact_area_fraction, rel=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("cell", [TETRAHEDRA, HEXAHEDRA])
@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
def test_a_rotated_and_shifted_copy_gives_the_same(cell, mode):
    rotation = Rotation.from_euler("xyz", (0.4, -1.1, 2.0)).as_matrix()
    shift, found = np.array([3.0, -20.0, 7.0]), []
    for rigid in (False, True):
        mesh = box(cell=cell)
        tags = marked(mesh)
        frame = FaceFrame(origin=np.zeros(3), axes=np.eye(3))
        if rigid:
            mesh.geometry.x[:] = mesh.geometry.x @ rotation.T + shift
            frame = FaceFrame(origin=shift, axes=rotation.T)
        options = {"mode": mode, "patches": PATCHES, "frame": frame, "indenter": TILTED}
        rough, problem = pressed_face(compat.vector_space(mesh, 1), tags, laws=LAWS, **options)
        problem.solve()
        found.append((rough.force, *rough.moment, *rough.patch_pressure))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-11)


def in_series(approach, compliance):
    """Pressure of the law under an approach that a bar of some compliance shares."""
    return brentq(lambda p: LAW.pressure(approach - p * compliance) - p, 0.0, 100.0, xtol=1e-14)


def column(height=2.0, degree=1, cell=TETRAHEDRA, layers=4):
    """Mesh, tags and space of a column, and a displacement in it."""
    lengths = (0.5, 0.5, height)
    mesh = box(cells=(1, 1, layers), cell=cell, lengths=lengths)
    tags = marked(mesh, lengths)
    space = compat.vector_space(mesh, degree)
    return mesh, tags, space, fem.Function(space)


@pytest.mark.parametrize("cell", [TETRAHEDRA, HEXAHEDRA])
@pytest.mark.parametrize("degree", [1, 2])
def test_elastic_column_in_series_with_a_pointwise_law(cell, degree):
    young, height, approach = 500.0, 2.0, 0.05
    _, tags, space, _ = column(height, degree, cell)
    rough, problem = pressed_face(
        space, tags, laws=LAW, indenter=RigidPlane(approach=approach),
        work=lambda u: elastic(u, young, poisson=0.0), solver={"petsc_options": EXACT},
    )  # fmt: skip
    problem.solve()
    pressure = in_series(approach, height / young)
    assert rough.mode == "pointwise"
    assert rough.force == pytest.approx(0.25 * pressure, rel=1e-10)
    np.testing.assert_allclose(rough.pressure, pressure, rtol=1e-9)
    np.testing.assert_allclose(rough.closure, approach - pressure * height / young, rtol=1e-9)


def test_graded_column_and_thermal_strain():
    """E(z) in layers, and a free thermal strain that lifts the face, enter as resistances do."""
    height, layers, approach, thermal = 2.0, 4, 0.05, 3e-3
    mesh, tags, space, u = column(height, layers=layers)
    young = fem.Function(compat.scalar_space(mesh, 0, "DG"))
    young.interpolate(lambda x: 400.0 + 300.0 * np.floor(-x[2] * layers / height - 1e-9))
    rough = Interface(space, tags, TOP, laws=LAW, indenter=RigidPlane(approach=approach))
    rise = fem.Constant(mesh, PETSc.ScalarType(0.0))
    # without strain across, as a column of bars: only the strain along z is thermal
    test = ufl.TestFunction(space)
    inner = elastic(u, young, poisson=0.0) - young * rise * test[2].dx(2) * ufl.dx
    problem = ContactProblem(inner, u, [clamped(space, tags)], rough, petsc_options=EXACT)
    compliance = np.sum(height / layers / (400.0 + 300.0 * np.arange(layers)))
    for value in (0.0, thermal):
        rise.value = value
        lifted = approach + value * height
        problem.solve()
        assert rough.force == pytest.approx(0.25 * in_series(lifted, compliance), rel=1e-9)
    young.x.array[:] *= 2.0  # the matrix follows
    problem.solve()
    assert rough.force == pytest.approx(0.25 * in_series(lifted, 0.5 * compliance), rel=1e-9)


@pytest.mark.parametrize("in_matrix", [False, True])
def test_two_interfaces_hold_a_slab_between_two_planes(in_matrix):
    """Half the height is a column to the plane of symmetry. Contact alone holds it along z."""
    young, height, approach = 500.0, 2.0, 0.02
    _, tags, space, u = column(height)
    held = rollers(space, (0, 0.0), (1, 0.0)) + ([] if in_matrix else [clamped(space, tags)])
    faces = [
        Interface(space, tags, tag, laws=LAW, indenter=RigidPlane(approach=approach))
        for tag in (TOP, BOTTOM)
    ]
    form, given = elastic(u, young, poisson=0.0), {"petsc_options": EXACT, "in_matrix": in_matrix}
    problem = ContactProblem(form, u, held, faces, **given)
    problem.solve()
    pressure = in_series(approach, (0.5 if in_matrix else 1.0) * height / young)
    assert faces[0].force == pytest.approx(0.25 * pressure, rel=1e-8)
    if in_matrix:
        assert faces[1].force == pytest.approx(faces[0].force, rel=1e-8)
    else:  # what presses on a clamped face goes into the clamp
        assert faces[1].force == pytest.approx(0.25 * LAW.pressure(approach), rel=1e-12)
    assert problem.reaction()[2] == pytest.approx(faces[0].force - faces[1].force, abs=1e-9)


def test_nodes_of_the_faces_edge_may_be_held():
    """What contact adds to constrained unknowns goes into the supports: force equals reaction."""
    mesh = box(cells=(4, 4, 3))
    tags, space = marked(mesh), compat.vector_space(mesh, 1)
    nodes = fem.locate_dofs_topological(space, 2, at(mesh, 0, 0.0))
    held = fem.dirichletbc(np.array([0.0, 0.0, -1e-3], PETSc.ScalarType), nodes, space)
    for mode in ("patchwise", "pointwise"):
        options = {"mode": mode, "patches": PATCHES, "indenter": TILTED, "held": [held]}
        rough, problem = pressed_face(space, tags, laws=LAWS, **options)
        assert problem.solve() < 9
        assert problem.reaction()[2] == pytest.approx(rough.force, rel=1e-8)
        moved = problem.displacement.x.array.reshape(-1, 3)[nodes]
        np.testing.assert_allclose(moved, [[0.0, 0.0, -1e-3]] * len(nodes))


def test_large_strains_converge_quadratically():
    """Saint Venant and Kirchhoff's material is linear in Green's strain alone."""
    mesh = box(cells=(3, 3, 2))
    tags, space = marked(mesh), compat.vector_space(mesh, 1)
    u, test = fem.Function(space), ufl.TestFunction(space)
    gradient = ufl.Identity(3) + ufl.grad(u)
    green = 0.5 * (gradient.T * gradient - ufl.Identity(3))
    second = 20.0 * ufl.tr(green) * ufl.Identity(3) + 60.0 * green
    inner = ufl.inner(gradient * second, ufl.grad(test)) * ufl.dx
    rough = Interface(space, tags, TOP, laws=PowerLaw(2e3), indenter=RigidPlane(approach=0.1))
    problem = ContactProblem(inner, u, [clamped(space, tags)], rough)
    assert problem.solve() <= 8
    assert problem.reaction()[2] == pytest.approx(rough.force, rel=1e-8)
    assert problem.report.residuals[-1] < problem.report.residuals[-2] ** 1.5
    held = clamped(space, tags, (0.0, 0.0, 0.05))  # the support moves towards the plane
    moved = ContactProblem(inner, u, [held], rough)
    before = rough.force
    assert moved.solve() <= 8
    assert rough.force > 1.3 * before
