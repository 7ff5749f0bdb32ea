"""Hard blocks and loads: near incompressible, flat, slender; steep laws, long ways, large steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from hard.bench import Count, case, lawless, off, scene, solved
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, Control, PatchGrid
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.micro import influence_matrix
from patchlaw.multiscale import PatchContact, PatchLaw, PatchLaws, make_setup
from patchlaw.multiscale.laws.patch_law import repaired_law
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.multiscale.models.patch_contact import equilibrium

LAPS, MODULI, UNITS = 10, (4e9, 1e3, 1e12), {"m": 1e3, "um": 1e-3}
SOFT = {"patches__grid": [2, 2], "surface__grid": [16, 16]}


def stiff_block(nu: float, element: str, cells: list[int]) -> tuple[Any, ...]:
    """Compare a mesh to the half-space and what the block adds to it, in modes of its top."""
    laws = {"block__poisson_ratio": nu, **SOFT}
    mesh = solved("isolated", block__element=element, block__cells=cells, **laws)
    coupling = make_setup(scene("isolated", **laws))
    control = coupling.parts.path.control(coupling.parts.path.largest())
    right = PatchContact(coupling.make_laws(), coupling.bodies.patch_compliance()).press(control)
    return off(mesh, right.force_N), mesh


for nu, element, cells, bound in (
    (0.4999, "Q1", [8, 8, 8], 1.0), (0.4999, "Q2", [2, 2, 2], 0.1), (0.4999, "Q2", [4, 4, 4], 0.04),
    (0.4999, "Q2", [8, 8, 8], 0.03), (0.0, "Q2", [6, 6, 4], 5e-3), (-0.5, "Q2", [6, 6, 4], 5e-3),
):  # fmt: skip
    name = f"ν = {nu:g}, {element}, {' × '.join(map(str, cells))} cells".replace("-", "−")
    locks = "locks, with a warning" if (element, nu) == ("Q1", 0.4999) else "as decomposed"
    case(6, name, locks, bound)(
        lambda nu=nu, element=element, cells=cells: stiff_block(nu, element, cells)
    )


def other_units(kind: str, **changes: Any) -> tuple[Any, ...]:
    """State the scene in m, mm and µm; moduli 1 kPa and 1 TPa besides."""
    here, error = solved(kind, **changes), 0.0
    for unit, size in UNITS.items():
        for modulus in MODULI:
            there = solved(
                kind, surface__lengths=[f"1 {unit}"] * 2, block__height=f"1 {unit}",
                load__approach=f"{8 * size} um", block__young_modulus=f"{modulus} Pa", **changes,
            )  # fmt: skip
            error = max(error, off(there.force_N[-1] / size**2 / modulus, here.force_N[-1] / 4e9))
    return error, lawless(here) if kind == "concurrent" else here


for way, changes in {
    "isolated": {"coupling__interface": "pointwise"}, "consistent": {}, "concurrent": {}
}.items():  # fmt: skip
    name = f"m, mm, µm; 1 kPa, 4 GPa, 1 TPa ({way})"
    case(7, name, "the same over E L²", 1e-10)(
        lambda way=way, changes=changes: other_units(way, **changes)
    )


def flat_or_slender(**changes: Any) -> tuple[Any, ...]:
    """Press a mesh; plane and support bear the same force."""
    found = solved("isolated", coupling__interface="pointwise", **changes)
    return abs(found.steps[-1].imbalance or 0.0), found


for name, changes in {
    "pancake 50 : 1": {"block__height": "0.02 mm"}, "column 1 : 50": {"block__height": "50 mm"},
    "cells of 12 : 1": {"block__cells": [24, 24, 2]},
}.items():  # fmt: skip
    case(8, name, "plane and support agree", 1e-9)(
        lambda changes=changes: flat_or_slender(**changes)
    )


@case(8, "column 1 : 50, no laws", "its own length in series, F h (1/EA + e²/EI)", 0.01)
def column() -> tuple[Any, ...]:
    found = solved("concurrent", block__height="50 mm")
    force, last = found.force_N[-1], found.steps[-1]
    alone = solved("analytic", load__approach=None, load__force=[force])
    arm = np.hypot(*last.moment_N_mm) / force
    length = 50.0 * force / 4000.0 * (1.0 + 12.0 * arm**2)
    return off(found.approach_mm[-1] - alone.approach_mm[-1], length), lawless(found)


@case(9, "a step 100 times too large, and back by 8 µm to 0", "the way there; none at last", 1e-7)
def too_large() -> tuple[Any, ...]:
    found = solved("concurrent", load__approach=["800 um", "8 um", "0 um"])
    error = off(found.force_N[1], solved("concurrent").force_N[0]) + found.force_N[2]
    return error, lawless(found)


@case(10, "tilt of 40 µm/mm, most patches open", "as without laws", 0.05)
def tilted() -> tuple[Any, ...]:
    tilt = {"load__tilt": ["40 um/mm", "0 um/mm"], "load__steps": 4}
    found, right = (solved(kind, **tilt) for kind in ("consistent", "concurrent"))
    return off(found, right), found


@case(11, "approach shifted by ± 1e-4", "the slope of the curve", 0.02)
def shifted() -> tuple[Any, ...]:
    ends = [0.008 * (1.0 + shift) for shift in (-1e-4, 1e-4, -1e-2, 1e-2)]
    found = solved("consistent", load__approach=ends)
    slopes = np.diff(found.force_N)[[0, 2]] / np.diff(ends)[[0, 2]]
    return off(*slopes), found


def law(closure: Any, pressure: Any, shift: float) -> PatchLaw:
    """Return a law through points from first touch on, repaired where noise makes it fall."""
    closure, pressure = np.array(closure) + shift, np.array(pressure)
    none = np.zeros(len(closure))
    rows = LawRows(
        closure=closure, pressure=pressure, approach=closure, contact_area_fraction=none,
        contacts=none.astype(int), unresolved_displacement=none,
    )  # fmt: skip
    return repaired_law(PatchLaw(rows=rows, first_touch=shift, initial_separation=0.02))


GRID = np.linspace(0.0, 9e-3, 19)
NOISE = np.abs(1.0 + np.random.default_rng(4).normal(0.0, 0.3, 19))
LAWS = {
    "a kink": ([0.0, 4e-3, 4.01e-3, 9e-3], [0.0, 1.0, 60.0, 400.0]),
    "a plateau": ([0.0, 2e-3, 6e-3, 9e-3], [0.0, 20.0, 20.0, 90.0]),
    "a nearly vertical part": ([0.0, 1e-3, 1e-3 + 1e-9, 9e-3], [0.0, 1.0, 100.0, 120.0]),
    "noise, made to rise": (GRID, 4e5 * GRID**1.5 * NOISE),
}


def on_laws(points: tuple[Any, Any], control: Control) -> tuple[Any, ...]:
    """Press 16 patches with the same law from different touches on; what the equations lack."""
    patches = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
    laws = PatchLaws([law(*points, shift) for shift in np.linspace(0.0, 4e-3, 16)])
    yields = influence_matrix(patches) / (np.pi * 4092.0)
    state = equilibrium(laws, yields, patches, control)
    point = laws.along(state.local)
    lacks = np.abs(point.closure + yields @ point.pressure - state.plane[0]).max()
    lacks /= abs(state.plane[0])
    if control.force is not None:
        lacks += off(patches.area * point.pressure.sum(), control.force)
    return lacks, state


for name, points in LAWS.items():
    case(12, f"laws with {name}, 16 patches", "all equations", 1e-8)(
        lambda points=points: on_laws(points, Control(approach=0.01, tilt=(0.0, 0.0)))
    )
    case(16, f"force, laws with {name}", "all equations, the force", 1e-8)(
        lambda points=points: on_laws(points, Control(force=30.0, tilt=(0.0, 0.0)))
    )


@case(16, "force from 1e-9 N through first touch, and none", "the prescribed force", 1e-5)
def small_forces() -> tuple[Any, ...]:
    wanted = [1e-9, 1e-6, 1e-3, 1.0, 0.0]
    found = solved("consistent", load__approach=None, load__force=wanted)
    return off(found.force_N[:4], wanted[:4]) + found.force_N[4], found


def to_and_fro(kind: str, **changes: Any) -> tuple[Any, ...]:
    """Cycle between two approaches; all laps but the first are alike, and so are all tops."""
    found = solved(kind, load__approach=["8 um", "4 um"] * LAPS, load__steps=5, **changes)
    laps = found.force_N.reshape(LAPS, 10)
    error = max(off(laps[1:], laps[1]), off(laps[:, 4], laps[0, 4]))
    return error, lawless(found) if kind == "concurrent" else found


for kind in ("isolated", "consistent", "concurrent"):
    points = {"coupling__interface": "pointwise"} if kind == "isolated" else {}
    case(17, f"up and down, {kind}", "forces come back", 2e-8)(
        lambda kind=kind, points=points: to_and_fro(kind, **points)
    )


@case(18, "a cell pressed to a fiftieth of its height", "true residual of a linear solve", 1.1e-8)
def bad_cell() -> tuple[Any, ...]:
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(6, 6, 4))
    mesh = block_mesh(shape, MPI.COMM_SELF)
    x = mesh.mesh.geometry.x
    x[int(np.argmin(np.abs(x - np.array([0.5, 0.5, -0.5])).sum(axis=1))), 2] += 0.98 * 0.25
    block = Block(mesh, Material(young_modulus=4000.0, poisson_ratio=0.15))
    load = block.stiffness.createVecRight()
    load.array[:] = np.random.default_rng(5).standard_normal(block.owned_dofs)
    load.pointwiseMult(load, block.free)
    found, residual = load.duplicate(), load.duplicate()
    block.solver.setTolerances(rtol=1e-8)
    block.solver.solve(load, found)
    block.stiffness.mult(found, residual)
    residual.axpy(-1.0, load)
    error = residual.norm(PETSc.NormType.NORM_2) / load.norm()
    return error, Count(newton=0, linear=block.solver.its)


@case(
    20,
    "reference meshed too coarsely for a contact node",
    "no force, and a note; the prescribed force",
    1e-10,
)
def too_coarse() -> tuple[Any, ...]:
    coarse = {"reference__fine": 1.0, "block__element": "P1", "reference__meshes": 1}
    found = solved("reference", load__approach="0.2 um", **coarse)
    forced = solved("reference", load__approach=None, load__force=["0.5 N"], **coarse)
    told = any("no node of the finest mesh touches" in note for note in found.notes)
    return off(forced, 0.5) + found.force_N[-1] + (0.0 if told else 1.0), found, forced
