"""Supports that share an edge with the contact face: the same problem in dolfinx by itself."""

from dataclasses import dataclass

import numpy as np
import pytest
from dolfinx import fem
from helpers.box_msh import write_box
from helpers.contact_laws import PowerLaw, RangedLaw
from helpers.faces import at, tagged
from helpers.user_problems import HEXAHEDRA, TETRAHEDRA, box, elastic, pressed_face
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import Control, Friction, PatchGrid, ShearControl
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import (
    FacePair,
    LawContactProblem,
    LoadedFace,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    compat,
    contact_facets,
)
from patchlaw.macro.contact.face_equilibrium import checked_reaction
from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.cli import main
from patchlaw.support import NotBalanced, NotConverged

TOP, BOTTOM, WEST, EAST, SOUTH, NORTH = range(1, 7)
LENGTHS = (1.7, 1.1, 0.6)
YOUNG, NU = 3100.0, 0.27
MATERIAL_KEYS = {"young_modulus": YOUNG, "poisson_ratio": NU}
MATERIAL = Material(**MATERIAL_KEYS)
LAWS = [RangedLaw(k, touch) for k, touch in ((2.3e4, 0.0), (0.9e4, 7e-4))]
PATCHES = PatchGrid(grid=(2, 1), lengths=LENGTHS[:2])
FREE = None
SAME = 1e-7
"""Forces and approaches of two solutions by Newton's method, to 1e-9 of the load each; a soft beam
moves by more than its contact."""


@dataclass(frozen=True)
class Case:
    """A support of a box, by the marker of its faces, and what presses on the top."""

    supports: dict
    steps: tuple
    friction: float | None = None
    cell: object = TETRAHEDRA


def steps(*shears, force=3.7, **plane):
    return tuple(Control(force=force, shear=shear, **plane) for shear in (None, *shears))


CLAMPED, ROLLER_X, ROLLER_Y, ROLLER_Z = (0.0,) * 3, (0.0, FREE, FREE), (FREE, 0.0, FREE), None
SHIFTS = ShearControl(shift=(3.1e-3, -1.3e-3)), ShearControl(shift=(-2e-3, 1e-3))
CASES = {
    "beam": Case({WEST: CLAMPED}, steps(force=0.9)),
    "beam, free tilt": Case({WEST: CLAMPED}, steps(force=0.9, tilt=None)),
    "beam, moved": Case({WEST: (2e-4, 0.0, -1.3e-3)}, steps(force=0.9)),
    "between walls": Case({WEST: CLAMPED, EAST: CLAMPED}, steps(), cell=HEXAHEDRA),
    "rollers": Case(
        {BOTTOM: CLAMPED, WEST: ROLLER_X, EAST: ROLLER_X, SOUTH: ROLLER_Y, NORTH: ROLLER_Y},
        steps(*SHIFTS),
        0.4,
    ),
    "symmetry": Case(
        {BOTTOM: (FREE, FREE, 0.0), WEST: ROLLER_X, SOUTH: ROLLER_Y},
        steps(ShearControl(force=(0.37, 0.21)), *SHIFTS),
        0.4,
        HEXAHEDRA,
    ),
    "beam, moved, friction": Case({WEST: (2e-4, -3e-4, -1.3e-3)}, steps(*SHIFTS), 0.4),
}


SCENE = """
[surface]
spectrum = { hurst = 0.8, waves = [2, 4], rms_slope = 0.1, seed = 3 }
grid = [16, 16]
lengths = ["0.1 mm", "0.1 mm"]
[law]
kind = "representative"
[body]
mesh = "beam.msh"
contact = "top"
supports = [{ surface = "left" }]
young_modulus = "3.1 GPa"
poisson_ratio = 0.27
[load]
force = "1 N"
steps = 1
[output]
figures = false
report = false
check = "none"
contact = "none"
"""


def marked(mesh):
    """Facet tags of all six faces."""
    sides = [(2, 0.0), (2, -LENGTHS[2]), (0, 0.0), (0, LENGTHS[0]), (1, 0.0), (1, LENGTHS[1])]
    return tagged(mesh, {tag: at(mesh, *side) for tag, side in enumerate(sides, 1)})


def face_of(case, mesh, tags, order=1):
    supports = [Support(tag=tag, displacement=held) for tag, held in case.supports.items()]
    body = MeshedBody(TaggedMesh(mesh=mesh, facet_tags=tags), MATERIAL, supports, order=order)
    frame = FaceFrame(origin=np.zeros(3), axes=np.eye(3))
    return LoadedFace(body, contact_facets(mesh, tags.find(TOP), frame), PATCHES)


def own_problem(case, mesh, tags, mode, order):
    """The same problem, as a user writes it."""
    space = compat.vector_space(mesh, order)
    conditions = []
    for tag, held in case.supports.items():
        nodes = fem.locate_dofs_topological(space, 2, tags.find(tag))
        conditions += [
            fem.dirichletbc(PETSc.ScalarType(value), 3 * nodes + axis, space.sub(axis))
            for axis, value in enumerate(held)
            if value is not None
        ]
    return pressed_face(
        space, tags, TOP, laws=LAWS, patches=PATCHES, mode=mode, held=conditions,
        indenter=case.steps[0], friction=friction_of(case), work=lambda u: elastic(u, YOUNG, NU),
    )  # fmt: skip


def friction_of(case):
    return None if case.friction is None else Friction(coefficient=case.friction, poisson_ratio=NU)


OWN = [
    *((name, "pointwise", 1) for name in CASES),
    *((name, "patchwise", 1) for name in ("beam, free tilt", "rollers", "beam, moved, friction")),
    *((name, "pointwise", 2) for name in ("beam, moved", "symmetry")),
]
QUICK = ("rollers", "pointwise", 1), ("symmetry", "pointwise", 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "mode", "order"),
    [pytest.param(*one, marks=() if one in QUICK else pytest.mark.long) for one in OWN],
)
def test_laws_on_a_body_are_those_of_an_own_problem(name, mode, order):
    case = CASES[name]
    mesh = box((5, 4, 2), case.cell, MPI.COMM_SELF, LENGTHS)
    tags = marked(mesh)
    face = face_of(case, mesh, tags, order)
    problem = LawContactProblem(face, LAWS, mode, friction=friction_of(case))
    rough, own = own_problem(case, mesh, tags, mode, order)
    for control in case.steps:
        rough.indenter = control
        own.solve()
        state = problem.solve(control)
        assert state.force == pytest.approx(rough.force, rel=SAME)
        assert state.approach == pytest.approx(rough.plane.approach, rel=SAME)
        assert state.patch_force == pytest.approx(
            rough.patch_pressure * face.areas, abs=SAME * rough.force
        )
        if state.shear is not None:
            bound = case.friction * rough.force
            assert state.shear.force == pytest.approx(rough.shear_force, abs=1e-6 * bound)
        moved = face.body.function(state.displacement).x.array
        size = np.abs(own.displacement.x.array).max()
        np.testing.assert_allclose(moved, own.displacement.x.array, atol=1e-6 * size)
        preloaded = any(value for held in case.supports.values() for value in held)
        if not preloaded:
            assert own.reaction()[2] == pytest.approx(state.force, rel=SAME)
        assert state.reaction == pytest.approx(state.force, rel=SAME)


@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
def test_two_bodies_held_at_the_edge_are_one_on_softer_laws(mode):
    """Mirror images close by half of the gap each."""
    case = CASES["beam"]
    mesh = box((5, 4, 2), case.cell, MPI.COMM_SELF, LENGTHS)
    first = face_of(case, mesh, marked(mesh))
    other = box((5, 4, 2), case.cell, MPI.COMM_SELF, LENGTHS)
    tags = marked(other)
    other.geometry.x[:, 2] *= -1.0
    supports = [Support(tag=WEST)]
    whole = TaggedMesh(mesh=other, facet_tags=tags)
    body = MeshedBody(whole, MATERIAL, supports, normal=(0, 0, -1))
    frame = first.facets.frame
    second = LoadedFace(
        body, contact_facets(other, tags.find(TOP), frame, opposed=True), first.patches
    )
    pair = FacePair(first, second)
    found = LawContactProblem(pair, LAWS, mode).solve(Control(force=0.9))
    halves = [PowerLaw(law.k * 2.0**law.power, 0.5 * law.touch, law.power) for law in LAWS]
    alone = LawContactProblem(face_of(case, mesh, first.body.mesh.facet_tags), halves, mode)
    expected = alone.solve(Control(force=0.9))
    assert found.approach == pytest.approx(2.0 * expected.approach, rel=SAME)
    assert found.patch_force == pytest.approx(expected.patch_force, rel=SAME)
    assert found.reaction == pytest.approx(0.9, rel=SAME)


def held_by_none(_face, nodes):
    """Let contact move and load the nodes that supports hold, as it once did."""
    return np.zeros((*nodes.shape, 3), dtype=bool)


@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
@pytest.mark.parametrize("name", ["beam", "symmetry"])
def test_what_supports_do_not_bear_is_an_error(name, mode, monkeypatch):
    """Where contact moved the nodes that supports hold, forces were 180 % off and said so alone."""
    case = CASES[name]
    mesh = box((5, 4, 2), case.cell, MPI.COMM_SELF, LENGTHS)
    monkeypatch.setattr(LoadedFace, "supported", held_by_none)
    face = face_of(case, mesh, marked(mesh))
    problem = LawContactProblem(face, LAWS, mode, friction=friction_of(case))
    match = r"NOT_BALANCED: the supports of the body bear a \w+ of .* against .* by the contact"
    with pytest.raises(NotBalanced, match=match):
        for control in case.steps:
            problem.solve(control)


def test_a_moment_that_supports_do_not_bear_is_an_error():
    """Pressures whose sum is right, on other places; a part in 10⁵ is found."""
    mesh = box((5, 4, 2), TETRAHEDRA, MPI.COMM_SELF, LENGTHS)
    face = face_of(Case({BOTTOM: CLAMPED}, ()), mesh, marked(mesh))
    load = face.load(np.array([1.3, 0.7]))
    displacement = load.duplicate()
    face.body.solver.solve(load, displacement)
    force = float(face.areas @ [1.3, 0.7])
    known = {"force": force, "tolerance": 1e-9, "what": "the body", "iterations": 1}
    assert checked_reaction(face, displacement, load, **known) == pytest.approx(force, rel=1e-8)
    turned = face.load(np.array([1.3 - 2e-5, 0.7 + 2e-5]))
    with pytest.raises(NotBalanced, match=r"bear a moment of .* N mm about the middle of the"):
        checked_reaction(face, displacement, turned, **known)
    with pytest.raises(NotBalanced, match=r"bear a force of .* along the normal"):
        checked_reaction(face, displacement, load, **known | {"force": force * (1.0 + 1e-5)})
    with pytest.raises(NotBalanced, match=r"bear a force of .* along the second axis"):
        checked_reaction(face, displacement, load, shear=(0.0, 1e-5 * force), **known)


@pytest.mark.slow
def test_a_scene_without_balance_ends_with_exit_code_3(monkeypatch, tmp_path, capsys):
    """At once: smaller load steps do not help. What held before stays as it was."""
    write_box(tmp_path / "beam.msh", [np.linspace(0.0, end, 4) for end in LENGTHS])
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "scene.toml", "--out", "right"]) == 0
    monkeypatch.setattr(LoadedFace, "supported", held_by_none)
    capsys.readouterr()
    assert main(["run", "scene.toml", "--out", "wrong"]) == 3
    said = "".join(capsys.readouterr())
    assert "load step 1 (force 1 N) did not converge: NOT_BALANCED" in said
    assert "halved" not in said


@pytest.mark.slow
@pytest.mark.parametrize(
    "method",
    ["active-set", pytest.param("augmented-lagrangian", marks=pytest.mark.long), "concurrent"],
)
def test_no_plane_presses_what_supports_hold(method, tmp_path):
    """Its plane stops above them: they bore 19 % of the force, which no support had."""
    write_box(tmp_path / "beam.msh", [np.linspace(0.0, end, 4) for end in (1.0, 1.0, 0.6)])
    spectrum = {"hurst": 0.8, "waves": [1, 2], "rms_slope": 0.1, "seed": 3}
    body = {"mesh": str(tmp_path / "beam.msh"), "contact": "top", **MATERIAL_KEYS}

    on_cells = method == "concurrent"

    def pressed(approach):
        data = {
            "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": [1.0, 1.0]},
            "body": body | {"supports": [{"surface": "left"}]},
            "load": {"approach": approach, "steps": 1},
            "coupling": {"kind": "concurrent" if on_cells else "reference"},
            "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
        }
        if not on_cells:
            data["reference"] = {"method": method, "meshes": 1, "fine": 0.12}
        return run(Scene.from_dict(data)).steps[-1]

    before = pressed(12e-3)
    assert before.force_N > 0.0 and (on_cells or abs(before.imbalance) < 1e-8)
    match = r"load step 1 .*: SUPPORT_IN_CONTACT: the plane is up to \d\.\d+ µm below \d+ nodes of"
    if on_cells:
        match = r"load step 1 .*: SUPPORT_IN_CONTACT: the plane touches the face at its low x side"
    with pytest.raises(NotConverged, match=match):
        pressed(20e-3)
