"""The micro models by name."""

from __future__ import annotations

from patchlaw.geometry import Surface, find_asperities
from patchlaw.micro.asperities.model import MODELS, AsperityModel
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.micro.model import MicroModel
from patchlaw.support import InputError

MODEL_NAMES = (*MODELS, "half-space")
"""Names of all micro models."""


def micro_model(name: str, surface: Surface, *, contact_modulus: float) -> MicroModel:
    """Return the micro model of a surface whose border is free, as that of a block's top is.

    Args:
        name: A name in `MODEL_NAMES`.
        surface: The surface.
        contact_modulus: E* [MPa].

    Raises:
        InputError: When there is no such model, or the modulus is not positive.
    """
    if name == "half-space":
        return HalfSpaceModel(surface=surface, contact_modulus=contact_modulus)
    if name not in MODELS:
        raise InputError("unknown micro model", value=name, allowed=", ".join(MODEL_NAMES))
    asperities = find_asperities(surface)
    return AsperityModel(name, asperities, contact_modulus=contact_modulus)
