"""Types of arrays, and a cache of what is made for small ones."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import ParamSpec, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers."""

Flags: TypeAlias = NDArray[np.bool_]
"""Truth values."""

Indices: TypeAlias = NDArray[np.intp]
"""Indices into other arrays."""

Counts: TypeAlias = NDArray[np.int64]
"""Whole numbers: of things, or those that files give to nodes."""

Locals: TypeAlias = NDArray[np.int32]
"""Rank-local numbers of cells, facets and nodes, as dolfinx has them."""


P = ParamSpec("P")
T = TypeVar("T")


def cached_where_small(
    is_small: Callable[P, bool], *, most: int
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Return a decorator that caches the results of a function for some of its arguments.

    Args:
        is_small: Tells from the arguments, which are hashable, whether the result is cached.
        most: Results that are cached, those used last. They must not be changed.
    """

    def decorated(make: Callable[P, T]) -> Callable[P, T]:
        cached = lru_cache(maxsize=most)(make)

        @wraps(make)
        def made(*args: P.args, **kwargs: P.kwargs) -> T:
            return (cached if is_small(*args, **kwargs) else make)(*args, **kwargs)  # type: ignore[arg-type]

        made.cache_clear, made.cache_info = cached.cache_clear, cached.cache_info  # type: ignore[attr-defined]
        return made

    return decorated
