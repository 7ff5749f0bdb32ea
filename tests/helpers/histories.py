"""Load steps and histories that no run has made."""

import numpy as np

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale import History, LoadStep
from patchlaw.multiscale.loading.load_step import PatchState

ONES = PatchState(np.ones(1), np.ones(1), np.ones(1))


def load_step(number, **columns):
    """Return a load step of one patch, which carries nothing but for columns that are given."""
    names = "approach_mm", "force_N", "mean_pressure_MPa", "contact_area_fraction"
    usual = dict.fromkeys((*names, "mean_separation_mm"), 0.0) | {"patches": ONES}
    usual |= {"contacts": 1, "newton_iterations": 1}
    return LoadStep(step=number, **usual | columns)


def history_of(steps, area=1.0):
    """Return a history of load steps of one patch, of an area [mm²]."""
    return History(steps=tuple(steps), patches=PatchGrid(grid=(1, 1), lengths=(area, 1.0)))
