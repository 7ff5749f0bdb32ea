"""Counts of the kinds of work that a run consists of, and the time that they take on a machine."""

from __future__ import annotations

from dataclasses import dataclass, fields

from multiscale.machine.rates import Machine


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """How much of each kind of work there is; the names are those of the rates of `Machine`.

    Attributes:
        call: Small calls into numpy: interpreted work, whatever the sizes.
        passes: Additions in long arrays.
        transform: N log2 N of real transforms of N points.
        function: Logarithms.
        flop: Operations of dense or sparse factorisations.
        product: Entries of sparse matrices that vectors are multiplied with.
    """

    call: float = 0.0
    passes: float = 0.0
    transform: float = 0.0
    function: float = 0.0
    flop: float = 0.0
    product: float = 0.0

    def __add__(self, other: Work) -> Work:
        return Work(**{kind: count + other._counts[kind] for kind, count in self._counts.items()})

    def __mul__(self, times: float) -> Work:
        return Work(**{kind: count * times for kind, count in self._counts.items()})

    __rmul__ = __mul__

    def seconds(self, machine: Machine) -> float:
        """Return the time it takes [s]; rates of work that does not occur are not measured.

        Args:
            machine: How fast each kind of work is.
        """
        return sum(count * getattr(machine, kind) for kind, count in self._counts.items() if count)

    @property
    def _counts(self) -> dict[str, float]:
        return {field.name: getattr(self, field.name) for field in fields(self)}
