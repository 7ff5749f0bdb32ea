"""What contacts do to the summits and the surface around them, beyond what models return."""

import numpy as np

from patchlaw.geometry import Control
from patchlaw.micro import HertzContact


class AsperityState:
    """A contact state of an asperity model, with all contacts that there may be."""

    def __init__(self, model, state):
        self._state = state
        self.ellipses = model.pairs.ellipses(state.indentation)

    def __getattr__(self, name):
        return getattr(self._state, name)


def pressed(model, approach, *, tilt=(0.0, 0.0), start=None):
    """Press an asperity model to an approach."""
    state = model.press(Control(approach=approach, tilt=tilt), start=start)
    return AsperityState(model, state)


def places(asperities):
    """Return what pairs of contacts need of asperities, by name."""
    return {name: getattr(asperities, name) for name in ("x", "y", "angle", "radius")}


def interference(asperities, state):
    """Return the depth of the plane below each undisplaced summit, 0 for summits below it."""
    return np.maximum(asperities.interference(state.plane), 0.0)


def displacement(model, state):
    """Return the displacements of all summits by all contacts, also of summits below the plane."""
    own = state.indentation
    interacting = model.pairs.interact
    return own + model.pairs.evaluate(own).displacement if interacting else own


def surface_displacement(model, state, x, y):
    """Add up the fields of all contacts at points, each Hertz's, also where contacts merge."""
    total = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
    a, own = model.asperities, state.indentation
    round_ = model.pairs.circular
    for k in np.flatnonzero(own):  # one field at a time bounds the memory
        contact = HertzContact(
            contact_modulus=model.contact_modulus,
            radius_major=(a.radius if round_ else a.radius_major)[k],
            radius_minor=(a.radius if round_ else a.radius_minor)[k],
            indentation=own[k],
        )
        turned = ((x - a.x[k]) + 1j * (y - a.y[k])) * np.exp(-1j * a.angle[k])
        total += contact.displacement(turned.real, turned.imag)
    return total
