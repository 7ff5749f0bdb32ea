"""Expected errors of the force of every micro model, from measures of the contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from micro.auto_measures import ContactMeasures

CONTACT_TERMS = ("floor", "few", "area", "crowding", "eccentricity", "border", "cells", "waves")
GRID_TERMS = ("radius", "radius_many", "radius_square", "waves", "waves_square")


def contact_terms(at: ContactMeasures) -> NDArray[np.float64]:
    root = np.sqrt(max(at.regions, 1))
    return np.array(
        [
            1.0,
            1.0 / root,
            np.sqrt(at.contact_fraction),
            at.crowding,
            at.eccentricity**2,
            at.border_share,
            at.cells_per_radius**-2.0,
            at.cells_per_wave**-2.0,
        ]
    )


def grid_terms(at: ContactMeasures, factor: float) -> NDArray[np.float64]:
    radius, wave = factor * at.cells_per_radius, factor * at.cells_per_wave
    root = np.sqrt(max(at.regions, 1))
    return np.array([radius**-1.5 / root, radius**-1.5, radius**-2.0 / root, wave**-2.0, wave**-4.0])


def contact_error(kind: str, at: ContactMeasures) -> float:
    return 0.1


def grid_error(at: ContactMeasures, factor: float) -> float:
    return 0.1
