"""What laws of samples miss at the edges of their face."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from patchlaw.geometry import Material, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import Scene, representative_law, run
from patchlaw.multiscale.models.measured_errors import edges as edge_errors
from patchlaw.multiscale.models.measured_errors.edges import edge_width
from patchlaw.multiscale.results.accuracy import AccuracyVerdict, Decision

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.2)
SPECTRUM = {"hurst": 0.8, "waves": [1, 3], "rms_slope": 0.1, "seed": 11}
PRESSURE, TILES = 15.0, 3


def sample(cells=24):
    surface = synthesise(Spectrum(**SPECTRUM), grid=(cells, cells), lengths=(1.0, 1.0))
    return HalfSpaceModel(surface, contact_modulus=MATERIAL.contact_modulus, periodic=True)


def width_of(model, pressure=PRESSURE):
    """Return the width by the law of the cells of the sample themselves."""
    most = min(2.0 * pressure, 0.95 * (model.hardness or np.inf))
    law = representative_law(
        [model.surface],
        MATERIAL.contact_modulus,
        largest_pressure=most,
        tolerance=0.05,
        make_model=lambda _: model,
    )
    return edge_width(model, law, float(law.closure_under(pressure)), MATERIAL)


def test_width_is_a_share_of_the_distance_of_contacts_at_any_size():
    model = sample()
    width = width_of(model)
    assert 0.0 < width < 0.5 / SPECTRUM["waves"][0]
    surface = model.surface.scaled(10.0)
    larger = HalfSpaceModel(
        type(surface)(heights=surface.heights, lengths=(10.0, 10.0), periodic=True),
        contact_modulus=MATERIAL.contact_modulus,
        periodic=True,
    )
    assert width_of(larger) == pytest.approx(10.0 * width, rel=1e-6)


def test_width_belongs_to_the_edge_and_not_to_the_face(monkeypatch):
    """A face of three periods has 1.5 times the edges of one of two, on 2.25 times the area."""
    width = width_of(sample())
    monkeypatch.setattr(edge_errors, "_PERIODS", 3)
    monkeypatch.setattr(edge_errors, "_COARSE", 24)
    # 0.78 to 0.85 on four surfaces, as corners soften the smaller face more
    assert 0.7 < width_of(sample()) / width < 0.9


def test_width_is_known_where_nearly_all_yields():
    """The law is known up to 0.95 of the hardness, and goes on as a line."""
    model = replace(sample(), hardness=PRESSURE / 0.97)
    assert 0.0 < width_of(model) < 0.5 / SPECTRUM["waves"][0]


@pytest.mark.long
def test_width_does_not_jump_near_the_hardness():
    """Where twice the pressure, and the pressure itself, pass the last row of the law."""
    model = replace(sample(12), hardness=PRESSURE / 0.95)
    for power in (2, 3):
        at = PRESSURE / 8.0 * 2.0**power
        below, above = (width_of(model, at * (1.0 + step)) for step in (-1e-6, 1e-6))
        assert above == pytest.approx(below, rel=1e-3)  # 1 to 4e-4 by the step itself


BLOCK = {"young_modulus": 4000.0, "poisson_ratio": 0.2, "height": 1.0}
QUIET = {"figures": False, "report": False}


@cache
def laws_on_block(sides):
    """Return the load step of laws of a sample on a block of 3 × 3 of them."""
    surface = {"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [1.0, 1.0], "periodic": True}
    data = {
        "surface": surface,
        "block": BLOCK | {"sides": sides, "lengths": [TILES, TILES], "cells": [3, 3, 2]},
        "law": {"kind": "representative"},
        "load": {"pressure": PRESSURE, "steps": 1},
        "output": QUIET | {"check": "last"},
    }
    return run(Scene.from_dict(data)).steps[-1]


@pytest.mark.slow
def test_edges_are_an_error_of_free_sides_alone():
    free, rollers = (dict(laws_on_block(sides).errors) for sides in ("free", "roller"))
    assert free["edges"] > 0.0
    assert rollers["edges"] == 0.0


def test_an_accuracy_that_edges_forbid_says_what_to_do():
    causes, told = {"mesh": 0.0, "edges": 0.1}, "by edges, which no refinement lessens: take cells"
    measured = AccuracyVerdict(requested=1e-3, error=0.1, step=1, causes=causes).sentence
    before = Decision(accuracy=1e-3, taken="", errors=causes).warning
    assert told in measured
    assert told in before


def test_the_error_at_the_edges_is_what_cells_on_the_whole_face_tell(tmp_path):
    """Nine samples beside each other, pressed in all their cells on the same block."""
    laws, heights = laws_on_block("free"), tmp_path / "face.npy"
    np.save(heights, np.tile(sample(16).surface.heights, (TILES, TILES)))
    data = {
        "surface": {"file": str(heights), "lengths": [float(TILES), float(TILES)]},
        "block": BLOCK | {"sides": "free"},
        "micro": {"finite_slopes": False},  # as in the laws
        "coupling": {"kind": "concurrent"},
        "load": {"force": laws.force_N, "steps": 1},
        "output": QUIET | {"check": "none"},
    }
    cells = run(Scene.from_dict(data)).steps[-1]
    errors = dict(laws.errors)
    stiffness = sum(errors.values()) / laws.approach_error_mm
    missed = stiffness * (cells.approach_mm - laws.approach_mm)
    # 1.25 times as much: the body is displaced by what its edges carry
    assert 0.8 * errors["edges"] < missed < 1.6 * errors["edges"]
