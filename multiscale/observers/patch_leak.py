"""The leak between two opposite sides of a surface whose contact is that of patch laws.

Every patch has one transmissivity, that of its own gaps between walls. The flow from patch to patch
is that through the cells of a map. It lies beside that through the gaps of all cells, which
`coupling.kind = "concurrent"` finds: paths that cross the borders of patches elsewhere than in the
mean are not known.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from micro.flow.gap_flow import cell_network
from multiscale.couplings.patch_laws import ConsistentCoupling
from multiscale.laws.transmissivity import Transmissivity
from multiscale.loading.leak import Leak
from multiscale.loading.load_step import LoadStep
from multiscale.observers.step_observers import StepObserver
from multiscale.results.leak_notes import leak_notes
from multiscale.scene.leak import LeakSection
from support.arrays import Array
from support.collective import on_root_alone
from support.errors import InputError
from support.network_flow import network_flow

_LEAST_CELLS = 4
"""Cells of a patch along a side, of which half are tried too."""


class PatchLeakObserver(StepObserver):
    """Adds what leaks from patch to patch to load steps.

    Args:
        coupling: What finds the load steps, with consistent laws.
        section: What its scene asks for.

    Raises:
        InputError: When patches have too few cells.
    """

    _coupling: ConsistentCoupling

    def __init__(self, coupling: ConsistentCoupling, section: LeakSection) -> None:
        super().__init__(coupling)
        self._section = section
        most = tuple(cells // _LEAST_CELLS for cells in coupling.surface.grid)
        if any(count > limit for count, limit in zip(coupling.patches.grid, most, strict=True)):
            raise InputError(
                f"leaves patches fewer than {_LEAST_CELLS} cells a side, too few for a leak",
                key="patches.grid",
                value=list(coupling.patches.grid),
                allowed=f"{most[0]} × {most[1]} at most",
                file=coupling.scene.file,
            )

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Return the load step with its leak and, where errors are measured, their error."""
        coupling = self._coupling
        with coupling.clock.phase("leak"):
            return replace(step, leaks=on_root_alone(coupling.comm, lambda: self._leaks(step)))

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        """Return the leaks from side to side."""
        section, patches = self._section, self._coupling.patches
        separations = self._separations(step)
        flows = [one.at(at) for one, at in separations]
        causes = {}
        if self._coupling.scene.output.check != "none":
            causes = {
                cause: np.concatenate([one.varied(cause, at) for one, at in separations])
                for cause in ("grid", "rows")
            }
        leaks, scale = [], section.drop / (12.0 * section.viscosity_MPa_s)
        for way in section.directions:
            axis = "xy".index(way)
            along, across = patches.lengths[axis], patches.lengths[1 - axis]
            total = self._total(np.concatenate(flows), axis)
            cubed = total * along / across
            factor = cubed / step.mean_separation_mm**3 if step.mean_separation_mm else None
            leak = Leak(way=way, rate=scale * total, transmissivity=cubed, flow_factor=factor)
            errors = {
                cause: abs(scale * (self._total(values, axis) - total))
                for cause, values in causes.items()
            }
            leaks.append(leak.with_errors(errors) if errors else leak)
        return tuple(leaks)

    def _separations(self, step: LoadStep) -> list[tuple[Transmissivity, Array]]:
        """Return what the patches let through, with their mean separation at a load step."""
        table = self._coupling.table
        assert table is not None
        found = []
        for law, closure in zip(table.laws, step.patches.closure_mm, strict=True):
            assert law.transmissivity is not None
            at = np.array([closure])
            found.append((law.transmissivity, law.at(at, extend=True).separation))
        return found

    def _total(self, transmissivity: Array, axis: int) -> float:
        """Return the flow through patches of T along x and y, shape (N, 2) [mm³]."""
        patches = self._coupling.patches
        own = [transmissivity[:, k].reshape(patches.grid) for k in (axis, 1 - axis)]
        lengths = patches.lengths
        if axis:
            own, lengths = [one.T for one in own], lengths[::-1]
        return network_flow(cell_network(own[0], lengths, across=own[1])).total

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak."""
        yield from leak_notes(steps)
        if steps:
            count = self._coupling.patches.count
            yield (
                f"the leak is that through {count} patches of one transmissivity each; "
                "coupling.kind = 'concurrent' finds that through all gaps"
            )
