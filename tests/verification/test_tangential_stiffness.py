"""Tangential stiffness is the slope of the curve where the shift goes on as it changed last.

The witness is the difference quotient of small steps, also just after a turn of the path, where
cells at their bound slip against the new direction, along it, or across.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pressed_cells import pressed_cells

from patchlaw.geometry import Control, Material, MaterialPair, ShearControl, Spectrum, synthesise
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.micro.friction import coupled
from patchlaw.multiscale import Run

FORCE, MU = 7.3, 0.45
PATH = (
    (0.31, 0.0),
    (0.64, 0.03),
    (0.57, 0.03),
    (0.57, 0.09),
    (0.52, 0.57),
    (0.61, 0.64),
    (-0.4, 0.2),
)
"""Shifts in those over which all would stick: on, back, aside, far aside, and back again."""


def cells(nu, *, periodic=False, couples=False):
    spectrum = Spectrum(hurst=0.73, waves=(2, 9), rms_slope=0.11, seed=31)
    surface = synthesise(spectrum, grid=(32, 32), lengths=(1.0, 1.0))
    pair = MaterialPair(first=Material(young_modulus=2900.0, poisson_ratio=nu))
    modulus, spacing = pair.contact_modulus, surface.spacing
    normal = HalfSpaceModel(surface, contact_modulus=modulus, periodic=periodic, tolerance=1e-11)
    friction = FrictionModel(
        materials=pair,
        coefficient=MU,
        spacing=spacing,
        periodic=periodic,
        tolerance=1e-10,
        coupled=couples,
    )
    return normal, friction


def along(step, *forces):
    """Return what the shear force gains along a small step of the shift, over its length."""
    before, after = (np.array(force) for force in forces)
    return float((after - before) @ step) / float(step @ step)


@pytest.mark.parametrize(("nu", "periodic"), [(0.0, False), (0.37, True)])
def test_the_slope_of_cells_after_turns(nu, periodic):
    normal, friction = cells(nu, periodic=periodic)
    pressures = normal.solve_force(FORCE).pressures
    state = friction.advance(None, pressures, ShearControl(shift=(0.0, 0.0)))
    scale = MU * FORCE / friction.stiffness(state)[0]
    for shift in PATH:
        state = friction.advance(
            state, pressures, ShearControl(shift=tuple(scale * np.array(shift)))
        )
        step = 1e-4 * scale * np.array(state.direction)
        ahead = ShearControl(shift=tuple(np.array(state.shift) + step))
        quotient = along(step, state.force, friction.advance(state, pressures, ahead).force)
        # the slope falls over the step, by up to 3e-3 where it ends near what slides
        assert friction.stiffness(state)[0] == pytest.approx(quotient, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("fixed", [pytest.param("force", marks=pytest.mark.slow), "approach"])
def test_the_slope_of_coupled_cells_after_turns(fixed, monkeypatch):
    monkeypatch.setattr(coupled, "TOLERANCE", 1e-10)  # for differences
    normal, friction = cells(0.21, couples=True)
    unsheared = Control(force=FORCE, shear=ShearControl(shift=(0.0, 0.0)))
    state, shear = coupled.press_coupled(normal, friction, unsheared, None)
    load = {"force": FORCE} if fixed == "force" else {"approach": state.approach}
    scale = MU * FORCE / friction.stiffness(shear)[0]

    def at(shift):
        control = Control(**load, shear=ShearControl(shift=tuple(map(float, shift))))
        return coupled.press_coupled(normal, friction, control, shear, start=state.start)

    for shift in PATH[:5]:
        state, shear = at(scale * np.array(shift))
        step = 1e-4 * scale * np.array(shear.direction)
        quotient = along(step, shear.force, at(np.array(shear.shift) + step)[1].force)
        slope, _ = coupled.coupled_stiffness(normal, friction, Control(**load), state, shear)
        assert slope == pytest.approx(quotient, rel=1e-3)
        # what friction alone, without the pressures that change, has for a slope
        assert abs(friction.stiffness(shear)[0] / slope - 1.0) > 1e-3


@pytest.mark.long
def test_the_slope_of_laws_after_turns():
    scale, force = 1.1e-3, 42.0
    sections = {
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.3, "cells": [3, 3, 2]},
        "friction": {"coefficient": MU},
        "law": {"kind": "representative"},
        "coupling": None,
        "patches": None,
    }
    sections["block"] |= {"lengths": [3.0, 3.0], "height": 2.0}
    points = [[scale * x, scale * y] for x, y in PATH]
    load = {"force": force, "steps": 1, "shear": points, "shear_steps": 1}
    run = Run(pressed_cells("consistent", load, **sections))
    solver = run.coupling.model
    slopes = []
    for step in run.load_steps():
        past, control, slips = solver.past, step.control, solver.slips
        way = 1e-3 * scale * slips.direction
        on = replace(control, shear=ShearControl(shift=tuple(slips.shift + way)))
        here, there = (
            (one.shear_force_x_N, one.shear_force_y_N) for one in (step, solver.press(on))
        )
        solver.past = past
        slopes.append(step.tangential_stiffness_N_per_mm)
        # Newton's method leaves 1e-9 of the force in 1e-3 of it, and the slope falls
        assert slopes[-1] == pytest.approx(along(way, here, there), rel=1e-4)
    # back from partial slip the joint is stiffer
    assert slopes[3] > 1.002 * slopes[2]
