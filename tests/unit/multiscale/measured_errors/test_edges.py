"""What laws of samples miss at the edges of their face."""

from dataclasses import replace

import pytest

from geometry import Material, Spectrum, synthesise
from micro import HalfSpaceModel
from multiscale import Scene, run
from multiscale.measured_errors import edges as edge_errors
from multiscale.measured_errors.edges import edge_width

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.2)
SPECTRUM = {"hurst": 0.8, "waves": [1, 3], "rms_slope": 0.1, "seed": 11}
PRESSURE, TILES = 15.0, 3


def sample(cells=24):
    surface = synthesise(Spectrum(**SPECTRUM), grid=(cells, cells), lengths=(1.0, 1.0))
    return HalfSpaceModel(surface, contact_modulus=MATERIAL.contact_modulus, periodic=True)


def test_width_is_a_share_of_the_distance_of_contacts_at_any_size():
    model = sample()
    width = edge_width(model, PRESSURE, MATERIAL)
    assert 0.0 < width < 0.5 / SPECTRUM["waves"][0]
    surface = model.surface.scaled(10.0)
    larger = HalfSpaceModel(
        type(surface)(heights=surface.heights, lengths=(10.0, 10.0), periodic=True),
        contact_modulus=MATERIAL.contact_modulus,
        periodic=True,
    )
    assert edge_width(larger, PRESSURE, MATERIAL) == pytest.approx(10.0 * width, rel=1e-6)


def test_width_belongs_to_the_edge_and_not_to_the_face(monkeypatch):
    """A face of three periods has 1.5 times the edges of one of two, on 2.25 times the area."""
    width = edge_width(sample(), PRESSURE, MATERIAL)
    monkeypatch.setattr(edge_errors, "_PERIODS", 3)
    monkeypatch.setattr(edge_errors, "_COARSE", 24)
    # 0.78 to 0.85 of it on four surfaces, as corners soften the smaller face more
    assert edge_width(sample(), PRESSURE, MATERIAL) == pytest.approx(width, rel=0.35)


def test_width_is_known_where_nearly_all_yields():
    """The law is known up to 0.95 of the hardness, and goes on as a line."""
    model = replace(sample(), hardness=PRESSURE / 0.97)
    assert 0.0 < edge_width(model, PRESSURE, MATERIAL) < 0.5 / SPECTRUM["waves"][0]


def laws_on_block(**block):
    """Return the load step of laws of a sample on a block of 3 × 3 of them."""
    block = {"young_modulus": 4000.0, "poisson_ratio": 0.2, "height": 1.0} | block
    block |= {"lengths": [TILES, TILES], "cells": [6, 6, 3]}
    surface = {"spectrum": SPECTRUM, "grid": [24, 24], "lengths": [1.0, 1.0], "periodic": True}
    return run(
        Scene.from_dict(
            {
                "surface": surface,
                "block": block,
                "law": {"kind": "representative"},
                "load": {"pressure": PRESSURE, "steps": 1},
                "output": {"figures": False, "report": False, "check": "last"},
            }
        )
    ).steps[-1]


def test_edges_are_an_error_of_free_sides_alone():
    free, rollers = (dict(laws_on_block(sides=sides).errors) for sides in ("free", "roller"))
    assert free["edges"] > 0.0
    assert rollers["edges"] == 0.0
    width = edge_width(sample(), PRESSURE, MATERIAL)
    whole = width * 4.0 * TILES * PRESSURE
    # the plane presses more on the edges, and the body gives way to what they carry
    assert 0.2 * whole < free["edges"] < 2.0 * whole
