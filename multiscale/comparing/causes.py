"""Splits the error of a level by its causes, as far as the levels at hand allow.

Between a level and the one it is compared with lie at most three models without any error of their
own kind: the best half-space (H), the best concurrent coupling (C), which is the smooth block, and
the best explicit reference (R). Differences between them add up, so that

    X − A  =  (X − best of X's kind)  +  steps between the best, H → C → R, up to A:

the first by the level's own micro model, coupling and discretisation, H − C by the half-space in
place of the finite block, C − R by slopes taken as small, and by the discretisation of both. All
are taken at the last load step and relative to A, of the force, or of the approach where the force
is prescribed.
"""

from __future__ import annotations

from dataclasses import dataclass

_PLACES = {"analytic": 0, "isolated": 1, "consistent": 1, "concurrent": 1, "reference": 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """Shares of a level's error, signed; they add up to it. None where it cannot be told.

    Attributes:
        micro: By the micro model: what it errs on the half-space.
        coupling: By what the coupling leaves out; on the mesh, by its elements too.
        block: By the half-space in place of the finite block.
        slopes: By slopes taken as small: from an explicit reference with heights and load that
            are ten times smaller, on the same mesh; without one, estimated to first order.
        discretisation: By grids and meshes, and all that could not be told apart.
    """

    micro: float | None = None
    coupling: float | None = None
    block: float | None = None
    slopes: float | None = None
    discretisation: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Best:
    """The best levels of each kind at the last load step; None where none was reached.

    Attributes:
        half_space: Force, or approach, of the finest half-space.
        block: That of the finest concurrent coupling.
        rough: That of the best explicit reference.
        slopes: Effect of finite slopes relative to the force, or approach; None when unknown.
    """

    half_space: float | None
    block: float | None
    rough: float | None
    slopes: float | None = None

    def at(self, place: int) -> float | None:
        """Return the value of the best level at a place on the way H, C, R."""
        return (self.half_space, self.block, self.rough)[place]


def causes(
    value: float,
    kind: str,
    *,
    against: float,
    against_kind: str,
    best: Best,
    twin: float | None,
    cells: bool,
) -> Causes:
    """Split the error of one level.

    Args:
        value: Its force, or approach, at the last load step.
        kind: Its coupling.
        against: That of the level that it is compared with.
        against_kind: The coupling of that one, the best of its kind.
        best: The best levels.
        twin: The value of the level's own micro model alone, on the same grid of heights.
        cells: Whether that micro model is the half-space, which errs by its cells only.
    """
    place, goal, laws = _PLACES[kind], _PLACES[against_kind], kind in ("isolated", "consistent")
    micro = 0.0 if place == 2 else _apart(twin, best.half_space, against)
    own = _apart(value, best.at(place), against)
    shares = {
        "micro": 0.0 if cells else micro,
        "coupling": None if own is None or micro is None else own - micro,
        "block": _block(best, place, goal, against),
        "slopes": _slopes(best, place, goal, against),
    }
    if not laws:
        shares["coupling"] = 0.0
    told = sum(share for share in shares.values() if share is not None)
    return Causes(**shares, discretisation=(value - against) / against - told)


def _apart(value: float | None, right: float | None, scale: float) -> float | None:
    return None if value is None or right is None else (value - right) / scale


def _block(best: Best, place: int, goal: int, scale: float) -> float | None:
    """Return H − C where it lies on the way, with the sign of the way."""
    if min(place, goal) > 0 or place == goal:
        return 0.0
    share = _apart(best.half_space, best.block, scale)
    return share if share is None or place == 0 else -share


def _slopes(best: Best, place: int, goal: int, scale: float) -> float | None:
    """Return the share of small slopes where just one of two levels has the roughness meshed."""
    if (place == 2) == (goal == 2):
        return 0.0
    if best.slopes is None:
        return None
    change = best.slopes * (scale if best.block is None else best.block) / scale
    return -change if goal == 2 else change
