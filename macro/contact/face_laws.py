"""Contact laws of a face: functions of closures and, where roughness runs in, of worn depths.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from patchlaw.support.arrays import Array, Indices
from patchlaw.support.checks import real_array
from patchlaw.support.errors import InputError


class ContactLaw(Protocol):
    """Contact pressure p of a patch as a function of its closure c.

    Closure is the approach of the plane minus the downward displacement of the block's surface
    [mm]. Pressures are positive in compression [MPa], and the stiffness is dp/dc ≥ 0 [MPa/mm]. Both
    must be defined for every closure, because Newton's iterates may leave the range of a tabulated
    law: whoever tabulates laws extends them and checks the converged closures.
    """

    def pressure(self, closure: Array, /) -> Array:
        """Return the pressures at closures of shape (n,)."""
        ...

    def stiffness(self, closure: Array, /) -> Array:
        """Return the exact derivative of the pressures at closures of shape (n,)."""
        ...


@runtime_checkable
class ContactLaws(Protocol):
    """The laws of all patches, evaluated together: as quick for many patches as for one.

    All take patches, shape (n,), the closures there of what is left, and the depths that have worn
    off, volume per area, (n,) each [mm]. Laws that do not run in take no notice of the depths.
    """

    def __len__(self) -> int:
        """Return the number of patches."""
        ...

    def pressures(self, patch: Indices, closure: Array, depth: Array, /) -> Array:
        """Return the pressures, shape (n,) [MPa]; see `ContactLaw`."""
        ...

    def stiffnesses(self, patch: Indices, closure: Array, depth: Array, /) -> Array:
        """Return their exact derivatives by the closures, shape (n,) [MPa/mm]."""
        ...

    def rates(self, patch: Indices, closure: Array, depth: Array, /) -> tuple[Array, Array, Array]:
        """Return pressures, these derivatives, and what they fall by with wear, (n,) each.

        As wear goes on under a plane that stays, closures fall by what wears off.
        """
        ...


class SingleLaws:
    """The laws of patches, evaluated one by one, and checked: they may be a user's functions.

    Args:
        laws: One law per patch.
    """

    def __init__(self, laws: Sequence[ContactLaw]) -> None:
        self.laws: tuple[Any, ...] = tuple(laws)

    def __len__(self) -> int:
        return len(self.laws)

    def pressures(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return the pressures, see `ContactLaws.pressures`."""
        return by_patch([law.pressure for law in self.laws], patch, closure)

    def stiffnesses(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return the stiffnesses, see `ContactLaws.stiffnesses`."""
        return by_patch([law.stiffness for law in self.laws], patch, closure)

    def rates(self, patch: Indices, closure: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Return pressures and stiffnesses, by which wear lessens them; see `ContactLaws.rates`."""
        slope = self.stiffnesses(patch, closure, depth)
        return self.pressures(patch, closure, depth), slope, slope

    def know(self, name: str) -> bool:
        """Tell whether all laws have an attribute."""
        return all(hasattr(law, name) for law in self.laws)

    def read_off(self, name: str, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return what laws with ``at`` give besides, on tangents beyond their tables, (n,)."""

        def given(law: Any) -> Callable[[Array], Array]:
            return lambda closure: np.asarray(getattr(law.at(closure, extend=True), name))

        return by_patch([given(law) for law in self.laws], patch, closure)

    def check_range(self, patch: Indices, closure: Array, depth: Array) -> None:
        """Refuse closures beyond the tables of laws; those without ``at`` have none."""
        for index in np.unique(patch):
            getattr(self.laws[index], "at", np.asarray)(closure[patch == index])

    def transmissivities(
        self, patch: Indices, closure: Array, depth: Array, places: Array
    ) -> Array:
        """Return the transmissivities of laws at points, shape (n, 2) [mm³].

        Args:
            patch: Patch of every point, shape (n,).
            closure: Closures there, shape (n,) [mm].
            depth: Worn depths, which these laws take no notice of.
            places: Places there in coordinates of the face, shape (n, 2) [mm]. A law whose
                ``transmissivities`` takes ``x`` beside the closure is told them.

        Raises:
            InputError: When a law has no ``transmissivities``, or gives no numbers ≥ 0 of that
                shape.
        """
        found = np.empty((len(closure), 2))
        for index, law in enumerate(self.laws):
            if not callable(getattr(law, "transmissivities", None)):
                raise InputError(
                    "the law knows no leak",
                    value=law,
                    allowed="a law with transmissivities(closure) of shape (n, 2) [mm³], such as "
                    "representative_law(…, leak=True)",
                )
            here = patch == index
            given = {"x": places[here]} if _takes_places(law.transmissivities) else {}
            values = real_array(law.transmissivities(closure[here], **given))
            if values.shape != (int(here.sum()), 2) or not (values >= 0.0).all():
                raise InputError(
                    f"law {index} gives no transmissivities",
                    value=values.shape,
                    allowed="numbers ≥ 0 along both axes for every closure",
                )
            found[here] = values
        return found


def _takes_places(function: Any) -> bool:
    """Tell whether a function takes ``x`` beside the closure, which may have any name."""
    try:
        return "x" in list(signature(function).parameters)[1:]
    except ValueError:  # functions of compiled modules may have none
        return False


def by_patch(
    functions: Sequence[Callable[[Array], Array]], patch: NDArray[np.intp], closure: Array
) -> Array:
    """Return functions of closure, one per patch, at samples, shape (n,).

    Args:
        functions: One function per patch.
        patch: Flat patch index of the samples, ascending, shape (n,).
        closure: Closures of the samples, shape (n,) [mm].

    Raises:
        InputError: When a function's values are no numbers, or not one for every closure.
    """
    values = np.empty_like(closure)
    ends = np.searchsorted(patch, np.arange(len(functions) + 1))
    for i in np.flatnonzero(np.diff(ends)):
        part = slice(ends[i], ends[i + 1])
        values[part] = one_each(functions[i](closure[part]), closure[part], f"law {i}")
    return values


def one_each(values: Any, points: Array, what: str) -> Array:
    """Return what a user's function gives at points as numbers, one for each."""
    try:
        numbers = real_array(values)  # what is masked is not a number
    except InputError as error:
        raise InputError(f"{what} gives no numbers: {error.problem}", value=values) from None
    if numbers.shape not in ((), points.shape):
        raise InputError(
            f"{what} does not give one value for each of {len(points)} points",
            value=numbers.shape,
            allowed=str(points.shape),
        )
    return numbers if numbers.shape else np.broadcast_to(numbers, points.shape)
