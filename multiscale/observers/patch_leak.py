"""The leak from patch to patch, where consistent laws stand for the contact.

Every patch has one transmissivity, that of its own gaps between walls. The flow from patch to patch
is that through the cells of a map. It lies beside that through the gaps of all cells, which
`coupling.kind = "concurrent"` finds: paths that cross the borders of patches elsewhere than in the
mean are not known.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from micro.flow.gap_flow import cell_network
from multiscale.couplings.coupling import Coupling
from multiscale.loading.leak import Leak
from multiscale.loading.load_step import LoadStep
from multiscale.observers.leak import LeakObserver
from support.arrays import Array
from support.collective import on_root_alone
from support.errors import InputError
from support.network_flow import network_flow

_LEAST_CELLS = 4
"""Cells of a patch along a side, of which half are tried too."""


class PatchLeakObserver(LeakObserver):
    """Adds what leaks from patch to patch.

    Args:
        coupling: What finds the load steps, with consistent laws.

    Raises:
        InputError: When patches have too few cells.
    """

    causes = ("grid", "rows")

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        most = tuple(cells // _LEAST_CELLS for cells in coupling.surface.grid)
        if any(count > limit for count, limit in zip(coupling.patches.grid, most, strict=True)):
            raise InputError(
                f"leaves patches fewer than {_LEAST_CELLS} cells a side, too few for a leak",
                key="patches.grid",
                value=list(coupling.patches.grid),
                allowed=f"{most[0]} × {most[1]} at most",
                file=coupling.scene.file,
            )

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        patches, leaks = self._coupling.patches, []
        for way, total in zip(self._section.directions, self._totals(step, None), strict=True):
            axis = "xy".index(way)
            cubed = total * patches.lengths[axis] / patches.lengths[1 - axis]
            factor = cubed / step.mean_separation_mm**3 if step.mean_separation_mm else None
            rate = self._scale * total
            leaks.append(Leak(way=way, rate=rate, transmissivity=cubed, flow_factor=factor))
        return tuple(leaks)

    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        return [self._scale * total for total in self._totals(step, cause)]

    def _totals(self, step: LoadStep, cause: str | None) -> list[float]:
        """Return the flows along all ways, with a cause of their error varied [mm³]; collective."""
        table = self._coupling.table
        assert table is not None

        def solve() -> list[float]:
            flows = []
            for law, closure in zip(table.laws, step.patches.closure_mm, strict=True):
                known = law.transmissivity
                assert known is not None
                at = law.at(np.array([closure]), extend=True).separation
                flows.append(known.at(at) if cause is None else known.varied(cause, at))
            through = np.concatenate(flows)
            return [self._total(through, "xy".index(way)) for way in self._section.directions]

        return on_root_alone(self._coupling.comm, solve)

    def _total(self, transmissivity: Array, axis: int) -> float:
        """Return the flow through patches of T along x and y, shape (N, 2) [mm³]."""
        patches = self._coupling.patches
        own = [transmissivity[:, k].reshape(patches.grid) for k in (axis, 1 - axis)]
        lengths = patches.lengths
        if axis:
            own, lengths = [one.T for one in own], lengths[::-1]
        return network_flow(cell_network(own[0], lengths, across=own[1])).total

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak, and of patches in its place."""
        yield from super().notes(steps)
        if steps:
            count = self._coupling.patches.count
            yield (
                f"the leak is that through {count} patches of one transmissivity each; "
                "coupling.kind = 'concurrent' finds that through all gaps"
            )
