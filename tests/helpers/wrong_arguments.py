"""Public functions and constructors with arguments that fit, and what fits none of them."""

import tempfile
from functools import cache
from math import inf, nan
from pathlib import Path

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from hypothesis import strategies as st
from mpi4py import MPI

from helpers.user_problems import PowerLaw
from patchlaw import (
    CellContact,
    ContactHistory,
    ContactProblem,
    Control,
    ElasticBlock,
    Friction,
    HalfSpaceModel,
    InputError,
    Interface,
    LawOperator,
    LawTable,
    LoadHistory,
    Material,
    NotConverged,
    PatchContact,
    PatchGrid,
    Problem,
    RigidPlane,
    Run,
    Scene,
    ShearControl,
    Spectrum,
    Step,
    Surface,
    compare,
    difference,
    export_laws,
    make_setup,
    natural_modes,
    read_contact,
    read_fields,
    read_history,
    read_laws,
    read_surface,
    representative_law,
    resolve,
    run,
    sweep,
    synthesise,
    vector_space,
    view,
    write_contact_stiffness,
)
from patchlaw.geometry import Regions

HEIGHTS = 5e-3 * np.random.default_rng(4).random((8, 8))
BAD = {
    "none": None,
    "text": "1/2",
    "empty text": "",
    "yes": "yes",
    "bytes": b"1",
    "nan": nan,
    "inf": inf,
    "minus inf": -inf,
    "negative": -1.5,
    "zero": 0,
    "huge": 10**400,
    "complex": 1.0 + 2.0j,
    "true": True,
    "object": object(),
    "empty": [],
    "dict": {},
    "set": {1.0, 2.0},
    "single": (1.0,),
    "triple": (1.0, 2.0, 3.0),
    "pair of nan": (nan, 0.0),
    "pair of texts": ("a", "b"),
    "pair of complex": (1.0j, 1.0),
    "pair of true": (True, True),
    "masked pair": np.ma.masked_array([1.0, 2.0], [False, True]),
    "masked number": np.ma.masked,
    "masked grid": np.ma.masked_array(HEIGHTS, HEIGHTS > 4e-3),
    "complex grid": HEIGHTS + 1.0j,
    "grid of nan": np.full((8, 8), nan),
    "ragged": [[1.0], [1.0, 2.0]],
    "objects": np.array([object(), object()]),
}
NUMBER, COUNT, NONE, EMPTY = {"negative", "zero"}, set(), {"none"}, {"empty"}
SEVERAL = {"single", "triple"}
TEXT = PATH = {"text", "empty text", "yes"}
"""Labels that are no mistake for an argument."""

SURFACE = Surface(heights=HEIGHTS, lengths=(1.0, 1.0))
SPECTRUM = Spectrum(hurst=0.8, waves=(2, 3), rms_slope=0.1)
PERIODIC = synthesise(SPECTRUM, grid=(16, 16), lengths=(1.0, 1.0))
MODEL = HalfSpaceModel(SURFACE, contact_modulus=4e3)
STEEL = Material(young_modulus=4e3, poisson_ratio=0.2)
LOADS = LoadHistory(force=(1.0,), steps=1)
GRID = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
SCENE = Scene.from_dict(
    {
        "surface": {"heights": HEIGHTS, "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.2},
        "micro": {"finite_slopes": False},
        "coupling": {"kind": "analytic"},
        "load": {"force": 1.0, "steps": 1},
        "output": {"check": "none", "figures": False, "report": False, "contact": "last"},
    }
)


@cache
def history():
    return run(SCENE)


@cache
def table():
    law = representative_law([PERIODIC], 4e3, largest_pressure=20.0)
    return LawTable(patches=Regions(("face",)), laws=(law,), made_by={})


@cache
def space():
    box = dmesh.create_box(MPI.COMM_SELF, [[0, 0, 0], [1, 1, 1]], [2, 2, 2])
    return vector_space(box, 1)


def top():
    return dmesh.locate_entities_boundary(space().mesh, 2, lambda x: np.isclose(x[2], 1.0))


@cache
def displacement():
    return fem.Function(space())


def form():
    v = ufl.TestFunction(space())
    return ufl.inner(ufl.grad(displacement()), ufl.grad(v)) * ufl.dx


@cache
def interface():
    indenter = RigidPlane(approach=0.1)
    made = Interface(space(), None, top(), laws=PowerLaw(k=1.0), indenter=indenter)
    made.evaluate(displacement())
    return made


@cache
def file_of_heights():
    path = Path(tempfile.mkdtemp()) / "heights.npy"
    np.save(path, HEIGHTS)
    return path


def six(scale):
    """Return a diagonal matrix of six unknowns."""
    from petsc4py import PETSc

    matrix = PETSc.Mat().createAIJ([6, 6], nnz=1)
    for row in range(6):
        matrix[row, row] = scale * (row + 1.0)
    matrix.assemble()
    return matrix


INTERFACE = {
    "space": space,
    "facet_tags": lambda: None,
    "tag": top,
    "laws": lambda: PowerLaw(k=1.0),
    "indenter": lambda: RigidPlane(approach=0.0),
}
PROBLEM = {"residual": form, "displacement": displacement}
CALLS = {
    "Surface": (Surface, {"heights": HEIGHTS, "lengths": (1.0, 1.0)}, {
        "heights": COUNT, "lengths": COUNT, "periodic": {"true"}, "source": TEXT,
        "notes": {"pair of texts"} | EMPTY}),
    "Surface.height_at": (SURFACE.height_at, {"x": 0.5, "y": 0.5}, {
        "x": {"zero", "empty", "single"}, "y": {"zero", "empty", "single"}}),
    "Surface.detrended": (SURFACE.detrended, {}, {"order": {"zero"}}),
    "Surface.piece": (SURFACE.piece, {"x": (0.0, 1.0), "y": (0.0, 1.0)}, {"x": COUNT, "y": COUNT}),
    "Surface.on_grid": (SURFACE.on_grid, {"grid": (8, 8)}, {"grid": COUNT}),
    "Surface.shifted": (PERIODIC.shifted, {"i": 1, "j": 1}, {
        "i": {"zero", "huge"}, "j": {"zero", "huge"}}),
    "Surface.scaled": (SURFACE.scaled, {"factor": 2.0}, {"factor": NUMBER}),
    "Spectrum": (Spectrum, {"hurst": 0.8, "waves": (2, 3), "rms_slope": 0.1}, {
        "hurst": {"zero"}, "waves": COUNT, "rms_slope": COUNT, "seed": {"zero"}}),
    "Spectrum of two bands": (
        Spectrum, {"hurst": 0.8, "waves_x": (2, 3), "waves_y": (2, 3), "rms_height": 0.1}, {
            "waves_x": COUNT, "waves_y": COUNT, "rms_height": COUNT}),
    "Spectrum of S0": (Spectrum, {"hurst": 0.8, "waves": (2, 3), "s0": 0.1}, {"s0": COUNT}),
    "synthesise": (synthesise, {"spectrum": SPECTRUM, "grid": (16, 16), "lengths": (1.0, 1.0)}, {
        "spectrum": COUNT, "grid": COUNT, "lengths": COUNT}),
    "read_surface": (read_surface, {"path": file_of_heights, "lengths": lambda: (1.0, 1.0)}, {
        "path": PATH, "lengths": NONE, "grid": NONE, "height_unit": NONE | TEXT, "xy_unit": NONE,
        "channel": NONE, "periodic": {"true"}}),
    "Control": (Control, {"approach": 1e-3}, {
        "approach": NUMBER, "tilt": NONE, "moment": COUNT, "body_state": {"zero"}, "shear": NONE,
        "slid": {"zero"}}),
    "Control of a force": (Control, {"force": 1.0}, {"force": {"zero"}}),
    "ShearControl": (ShearControl, {"shift": (0.0, 0.0)}, {"shift": COUNT}),
    "ShearControl of a force": (ShearControl, {"force": (0.0, 0.0)}, {"force": COUNT}),
    "RigidPlane": (RigidPlane, {"approach": 1e-3}, {
        "approach": NUMBER, "tilt": COUNT, "centre": NONE}),
    "Friction": (Friction, {"coefficient": 0.3}, {"coefficient": COUNT, "poisson_ratio": {
        "none", "zero"}}),
    "PatchGrid": (PatchGrid, {"grid": (2, 2), "lengths": (1.0, 1.0)}, {
        "grid": COUNT, "lengths": COUNT, "origin": COUNT}),
    "PatchGrid.index_of": (GRID.index_of, {"x": 0.5, "y": 0.5}, {
        "x": {"zero", "empty", "single"}, "y": {"zero", "empty", "single"}}),
    "PatchGrid.bounds": (GRID.bounds, {"i": 1}, {"i": {"zero"}}),
    "HalfSpaceModel": (HalfSpaceModel, {"surface": PERIODIC, "contact_modulus": 4e3}, {
        "surface": COUNT, "contact_modulus": COUNT, "periodic": {"true"}, "tolerance": COUNT,
        "highest": NUMBER | NONE, "sides": NONE, "body": NONE, "slopes": EMPTY, "hardness": NONE,
        "few": NONE, "sums_alone": {"true"}, "wear": COUNT | {"zero"}}),
    "HalfSpaceModel.solve": (MODEL.solve, {"approach": 1e-3}, {
        "approach": NUMBER, "tilt": COUNT, "start": NONE}),
    "HalfSpaceModel.solve_force": (MODEL.solve_force, {"force": 1.0}, {
        "force": {"zero"}, "tilt": NONE, "start": NONE}),
    "HalfSpaceModel.press": (MODEL.press, {"control": Control(force=1.0)}, {
        "control": COUNT, "patches": NONE, "mean_heights": {"none", "single"}, "start": NONE,
        "displaced": NONE}),
    "HalfSpaceModel.resampled": (MODEL.resampled, {"grid": (8, 8)}, {"grid": COUNT}),
    "representative_law": (
        representative_law,
        {"samples": [PERIODIC], "contact_modulus": 4e3, "largest_pressure": 20.0}, {
            "samples": COUNT, "contact_modulus": COUNT, "largest_pressure": COUNT,
            "tolerance": COUNT, "most_rows": COUNT, "make_model": NONE, "before": NONE,
            "leak": {"true"}, "comm": NONE, "observe": NONE}),
    "representative_law of a closure": (
        representative_law,
        {"samples": [PERIODIC], "contact_modulus": 4e3, "largest_closure": 1e-3}, {
            "largest_closure": COUNT}),
    "Scene.load": (Scene.load, {"path": "scene.toml"}, {
        "path": PATH, "overrides": EMPTY | {"pair of texts"}}),
    "Scene.from_dict": (Scene.from_dict, {"data": {}}, {"data": {"dict"}, "source": NONE}),
    "Scene.with_": (SCENE.with_, {"changes": {}}, {"changes": {"dict"}}),
    "Scene.to_dict": (SCENE.to_dict, {}, {"whole": {"true"}}),
    "run": (run, {"scene": SCENE}, {
        "scene": COUNT, "comm": NONE, "observe": NONE, "progress": {"true"}}),
    "Run": (Run, {"scene": SCENE}, {"scene": COUNT, "comm": NONE, "stated": NONE, "observe": NONE}),
    "make_setup": (make_setup, {"scene": SCENE}, {
        "scene": COUNT, "comm": NONE, "nodes": NONE, "read": NONE}),
    "resolve": (resolve, {"scene": SCENE}, {
        "scene": COUNT, "comm": NONE, "nodes": NONE, "read": NONE, "mesh_error": NONE,
        "observe": NONE}),
    "sweep": (sweep, {"scene": SCENE, "vary": {"load.force": [1.0]}}, {
        "scene": COUNT, "vary": COUNT, "comm": NONE, "folder": PATH | NONE, "part": COUNT,
        "observe": NONE, "progress": {"true"}}),
    "compare": (compare, {"scene": SCENE}, {
        "scene": COUNT, "comm": NONE, "against": NONE, "folder": PATH | NONE,
        "observe": NONE, "begun": NONE}),
    "difference": (difference, {"first": "a", "second": "b"}, {
        "first": PATH, "second": PATH, "names": {"none", "pair of texts"}, "at": NONE}),
    "read_history": (read_history, {"folder": "a"}, {"folder": PATH}),
    "read_contact": (read_contact, {"folder": "a"}, {"folder": PATH}),
    "read_fields": (read_fields, {"folder": "a"}, {"folder": PATH, "counter": {"true"}}),
    "view": (view, {"folder": "a"}, {
        "folder": PATH, "show": {"empty text", "text", "yes"}, "step": COUNT | NONE,
        "mode": COUNT | NONE, "off_screen": {"true"}}),
    "read_laws": (read_laws, {"path": "a"}, {"path": PATH}),
    "export_laws": (export_laws, {"table": table, "folder": lambda: "a", "format": lambda: "csv"}, {
        "table": COUNT, "folder": PATH, "format": COUNT, "tolerance": COUNT, "conducts": NONE,
        "friction": NONE, "name": {"empty text", "text", "yes"}}),
    "vector_space": (vector_space, {"mesh": lambda: space().mesh, "degree": lambda: 1}, {
        "mesh": COUNT, "degree": COUNT}),
    "Interface": (Interface, INTERFACE, {
        "space": COUNT, "facet_tags": NONE, "tag": EMPTY, "laws": COUNT, "indenter": COUNT,
        "mode": NONE, "patches": NONE, "frame": NONE, "bcs": EMPTY, "crown": NONE,
        "names": {"none", "dict"}, "friction": NONE, "opposite": NONE, "axisymmetric": set(),
        "wear": NONE}),
    "Interface.leak": (
        lambda **given: interface().leak(**given),
        {"inlet": top, "outlet": top, "viscosity": lambda: 1e-9,
         "pressures": lambda: (1.0, 0.0)}, {
            "inlet": EMPTY, "outlet": EMPTY, "viscosity": COUNT, "pressures": COUNT,
            "axes": COUNT, "centre": NONE}),
    "ContactProblem": (ContactProblem, PROBLEM, {
        "residual": COUNT, "displacement": COUNT, "bcs": EMPTY, "interfaces": EMPTY,
        "tangent": NONE, "petsc_options": {"none", "dict"}, "in_matrix": {"true"}}),
    "write_contact_stiffness": (
        write_contact_stiffness,
        {"path": Path(tempfile.mkdtemp()) / "springs.mtx", "stiffness": lambda: six(4.0),
         "space": space}, {
            "path": COUNT, "stiffness": COUNT, "space": COUNT}),
    "natural_modes": (
        natural_modes,
        {"stiffness": lambda: six(4.0), "mass": lambda: six(1.0), "count": 2}, {
            "stiffness": COUNT, "mass": COUNT, "count": COUNT, "bcs": EMPTY,
            "preconditioner": NONE}),
    "Material": (Material, {"young_modulus": 4e3, "poisson_ratio": 0.2}, {
        "young_modulus": COUNT, "poisson_ratio": {"zero"}, "density": NONE}),
    "ElasticBlock": (ElasticBlock, {"material": STEEL, "height": 1.0}, {
        "material": COUNT, "height": COUNT, "sides": COUNT, "margin": {"zero"}}),
    "ElasticBlock.terms": (ElasticBlock(STEEL, height=1.0).terms, {"lengths": (1.0, 1.0)}, {
        "lengths": COUNT, "side_term": {"true"}}),
    "ElasticBlock.compliance": (ElasticBlock(STEEL, height=1.0).compliance, {"patches": GRID}, {
        "patches": COUNT, "comm": NONE}),
    "CellContact": (CellContact, {"model": MODEL}, {
        "model": COUNT, "patches": NONE, "mean_heights": {"none", "single"}, "comm": NONE,
        "friction": NONE, "wear": {"zero"}}),
    "CellContact.of": (CellContact.of, {"surface": SURFACE, "body": STEEL}, {
        "surface": COUNT, "body": COUNT, "counter": NONE, "hardness": NONE, "friction": NONE,
        "finite_slopes": {"true"}, "periodic": {"true"}, "patches": NONE, "comm": NONE,
        "wear": {"zero"}}),
    "PatchContact": (PatchContact, {"table": table, "compliance": lambda: np.eye(4)}, {
        "table": COUNT, "compliance": COUNT}),
    "Problem": (Problem, {"model": lambda: CellContact(MODEL), "path": lambda: LOADS}, {
        "model": COUNT, "path": COUNT, "position": NONE, "force_change": NONE,
        "zero": NUMBER, "file": NONE | TEXT}),
    "Step of an approach": (Step, {"approach": 1e-3}, {"approach": NUMBER}),
    "Step": (Step, {"force": 1.0}, {
        "force": NUMBER, "carried": NUMBER, "tilt": NONE, "shear": NONE, "body_state": NUMBER,
        "stage": NONE, "turns": {"true"}, "key": TEXT, "slid": {"zero"}}),
    "LoadHistory": (LoadHistory, {"approach": (1e-3, 5e-4)}, {
        "zero": COUNT, "approach": SEVERAL, "stage": EMPTY, "steps": COUNT, "cycles": COUNT,
        "tilt": COUNT, "force_change": NONE,
        "shear_path": COUNT, "shear_cycles": COUNT, "sliding": SEVERAL | NONE}),
    "LoadHistory of a force": (LoadHistory, {"force": (1.0,)}, {
        "force": SEVERAL, "shear_steps": NONE}),
    "LoadHistory of a pressure": (LoadHistory, {"pressure": (1.0,)}, {"pressure": SEVERAL}),
    "LoadHistory of a shift": (LoadHistory, {"force": (1.0,), "shear": ((1e-4, 0.0),)}, {
        "shear": NONE | EMPTY}),
    "LoadHistory of a shear force": (
        LoadHistory, {"force": (1.0,), "shear_force": ((0.1, 0.0),)}, {
            "shear_force": NONE | EMPTY}),
    "LawOperator": (
        LawOperator, {"interface": interface, "displacement": displacement}, {
            "interface": COUNT, "displacement": COUNT, "degree": NONE}),
    "History.table": (
        lambda **given: history().table(**given), {"most": lambda: 3}, {"most": COUNT}),
    "Difference.of": (lambda **given: difference(history(), history()).of(**given), {}, {
        "name": COUNT}),
    "ContactHistory.at": (
        lambda **given: ContactHistory(records=history().contact_records).at(**given), {}, {
            "step": COUNT}),
}  # fmt: skip
"""By call: what is called, arguments that fit, and for every argument the labels of no mistake."""


def made(arguments):
    """Return arguments, those made that take a moment."""
    return {name: value() if callable(value) else value for name, value in arguments.items()}


DEAR = {"run", "Run", "make_setup", "resolve", "sweep", "compare", "representative_law"}
"""Calls that take seconds, or processes, where all arguments fit."""


def called(drawn):
    """Call with one argument replaced; tell whether it was refused."""
    call, name, value = drawn
    use, base, _ = CALLS[call]
    try:
        use(**(made(base) | {name: value}))
    except (InputError, NotConverged):
        return "refused"
    return "taken"


numbers = st.one_of(
    st.integers(), st.floats(), st.complex_numbers(), st.booleans(), st.just(10**400)
)
things = st.one_of(
    numbers,
    st.text(max_size=6),
    st.binary(max_size=3),
    st.sampled_from(list(BAD.values())),
    st.lists(numbers, max_size=4),
    st.tuples(numbers, numbers),
    st.dictionaries(st.text(max_size=2), numbers, max_size=2),
)
mistakes = st.one_of(
    st.tuples(st.just(call), st.sampled_from(sorted(arguments)), things)
    for call, (_, _, arguments) in CALLS.items()
    if call.partition(" of ")[0] not in DEAR
)
