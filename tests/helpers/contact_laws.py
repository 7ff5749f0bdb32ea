"""Contact laws in closed form, for tests."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from patchlaw.support import InputError


class Spring:
    """A law p = k c."""

    def __init__(self, k):
        self.k = k

    def pressure(self, closure):
        return self.k * closure

    def stiffness(self, closure):
        return np.full_like(closure, self.k)


@dataclass(frozen=True)
class PowerLaw:
    """p = k <c − c0>^m."""

    k: float
    touch: float = 0.0
    power: float = 1.5

    def pressure(self, closure):
        return self.k * np.maximum(closure - self.touch, 0.0) ** self.power

    def stiffness(self, closure):
        over = np.maximum(closure - self.touch, 0.0)
        return self.power * self.k * over ** (self.power - 1.0) * (closure > self.touch)


@dataclass(frozen=True)
class RangedLaw(PowerLaw):
    """A law that knows its area and range, as springs under friction need it."""

    end: float = 2e-2

    @property
    def range(self):
        return self.touch, self.end

    def at(self, closure, *, extend=False):
        if not extend and np.any(closure > self.end):
            raise InputError("closure beyond the end of the patch law")
        return SimpleNamespace(contact_area_fraction=np.clip(closure / 0.1, 0.0, 1.0))


@dataclass(frozen=True)
class Exponential:
    """p = a (exp(c / λ) − 1), the shape of laws of rough surfaces."""

    length: float
    scale: float = 1e-2
    reach: float = 9.0

    @property
    def range(self):
        return 0.0, self.reach * self.length

    def pressure(self, closure):
        return self.scale * np.expm1(np.clip(closure / self.length, 0.0, 300.0))

    def stiffness(self, closure):
        grown = self.scale * np.exp(np.clip(closure / self.length, 0.0, 300.0)) / self.length
        return np.where(closure > 0.0, grown, 0.0)
