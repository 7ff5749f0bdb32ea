"""Micro models pressed along approaches, every result as an array over them."""

import numpy as np

from patchlaw.geometry import stacked
from patchlaw.micro import press_along


class Along:
    """States of a model at several approaches; their attributes are arrays over the approaches."""

    def __init__(self, states):
        self.states = states

    def __getattr__(self, name):
        return stacked(self.states, name)

    def kappa(self, rms_slope, contact_modulus):
        """Return κ at every approach."""
        return np.array([state.kappa(rms_slope, contact_modulus) for state in self.states])


def respond(model, approaches, **given):
    """Press a model along approaches; see `press_along`."""
    return Along(press_along(model, approaches, **given))
