"""Predicts the times of the contact problems of a run from measured products with the compliance.

A solution takes products on the box of cells that can touch. Their number hardly depends on the
surface and grows with the logarithm of the grid: 15 to 60 were counted on 64² to 1024² cells, 2 to
64 waves and 0.1 to 3 % of contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from micro import HalfSpaceModel
from multiscale.planning.solved_boxes import Box, checks_finer, solved_boxes
from multiscale.setup.problem import ProblemSetup

_OVERHEAD, _SIZE_OVERHEAD = 2.5e-3, 25e-9
"""Time of a solution besides its products, and of it per cell of the surface [s]."""
_PRODUCTS, _PRODUCTS_PER_DOUBLING = 14.0, 3.0
"""Products of a solution: 14 and 3 for every doubling of the cells along a side."""
_DOUBLE, _SINGLE = 0.3, 0.65
"""Time of a product over that in double precision on all cells: three of ten are that, the others
are in single precision, with a product of the inverse, on the rows that hold contact alone."""
_FEW, _MANY = 0.7, 0.6
"""Products are 0.7 times as many where few of the rows hold contact, and 1.3 times where all do."""
_FROM_COARSE = 1.33
"""Factor of the work of a solution that starts from coarser grids."""
_FREE_MOTIONS = 1.25
"""Factor of the work where the plane's approach or tilt is free."""
_BODY_PRODUCT, _BODY_CELL = 0.2e-3, 30e-9
"""Time of a product with free sides and a finite body, and of it per cell [s]; 30 to 45 ns were
measured on 128² to 1024² cells."""
_PERIODIC = 0.33
"""Time of a product with a periodic half-space, without padding, over that with others."""
_SLOPES = 1.3
"""Factor of the products with finite slopes."""
_PASSES, _PASS, _PASS_CELL = 5.0, 1.0e-3, 40e-9
"""Solutions by which finite slopes converge, and the overhead of each and of it per cell [s]."""
_SLOPES_COARSE, _SLOPES_CELL = 3.6e-3, 65e-9
"""Time of evaluating finite slopes on 64² cells, which is the least on finer ones too, and per cell
[s]: 64² to 256² took 5 to 7 ms, 512² 16 to 28, 1024² 70 to 110."""
_SLOPES_LEAST = 64**2
_SLOPES_CACHED, _SLOPES_GROWTH = 2**20, 0.3
"""Cells beyond which that per cell grows with this power of them: to 155 ns on 4096²."""
_STIFFNESS = 0.3
"""Solutions that an interfacial stiffness is worth; 0.2 to 0.4 were measured."""
_CHECK_CELL = 0.4e-6
"""Time per cell of the finest grid of an error check of the surfaces on its grids [s]."""
_CHECK_BODY, _CHECK_BODY_CELL = 0.2, 2.5e-6
"""Time of free sides and body on the grids of an error check, and per cell of the surface [s]."""
_ESTIMATE_CELLS = 96
"""Cells along a side, at most, of the half-space that estimates the plane at the largest load."""


class Speed(Protocol):
    """How fast work is done: ratios to where it was measured, and products in seconds."""

    @property
    def arrays(self) -> float:
        """Ratio for numpy."""
        ...

    @property
    def sparse(self) -> float:
        """Ratio for sparse products."""
        ...

    def product(self, cells: float) -> float:
        """Return the time of a product with the half-space of so many cells [s]."""
        ...


@dataclass(frozen=True)
class ContactCosts:
    """Times of contact problems of one scene [s].

    Args:
        setup: The problem, with a micro model.
        speed: How fast work is done.
    """

    setup: ProblemSetup
    speed: Speed

    @property
    def cells(self) -> int:
        """Cells of the half-space, or heights of the surface for other micro models."""
        model = self.setup.model
        rough = model.surface if isinstance(model, HalfSpaceModel) else self.setup.surface
        return int(rough.heights.size)

    @property
    def on_cells(self) -> bool:
        """Whether the micro model is the half-space."""
        return isinstance(self.setup.micro, HalfSpaceModel)

    @cached_property
    def _free(self) -> bool:
        """Whether the approach of the plane, or its tilt, is free."""
        loads = self.setup.scene.loading.load_history
        return loads.quantity == "force" or loads.tilt is None

    @cached_property
    def boxes(self) -> Sequence[Box]:
        """The boxes that are solved at rising loads; see `solved_boxes`."""
        return solved_boxes(self.setup)

    @staticmethod
    def products(cells: float) -> float:
        """Return the products of a solution without finite slopes on so many cells."""
        return _PRODUCTS + _PRODUCTS_PER_DOUBLING * 0.5 * math.log2(max(cells, 1.0))

    def step(self) -> float:
        """Return the time of a load step or a row of laws, in the mean over loads."""
        if not self.on_cells:
            return self._of_summits(int(self.setup.interfering_summits.sum()))
        one = self._sloped if self.setup.finite_slopes else self._flat
        times = [one(self.cells, box, free=self._free) for box in self.boxes]
        return sum(times) / len(times)

    def patch(self) -> float:
        """Return the time of a row of the law of one patch alone."""
        setup = self.setup
        if self.on_cells:
            return self._flat(self.cells // setup.patches.count, Box(), on_half_space=True)
        summits = int(setup.interfering_summits.sum())
        return self._of_summits(summits // max(setup.interfering_patches, 1))

    def stiffness(self) -> float:
        """Return the time of the interfacial stiffness of a load step."""
        return _STIFFNESS * self.step()

    def check(self) -> float:
        """Return the time of measuring the errors of a load step at the largest load."""
        setup, box, cells = self.setup, self.boxes[-1], self.cells
        half = self._sloped(cells // 4, box)
        total = (1.6 + 0.6 * setup.has_block if setup.finite_slopes else 1.0) * half
        total += (1.0 + 0.4 * setup.has_block) * self._flat(cells // 4, box, cold=True)
        total += self._flat(cells // 16, box, cold=True)
        finer = checks_finer(setup, cells)
        total += self.speed.arrays * _CHECK_CELL * cells * (4 if finer else 1)
        if finer:
            total += self._flat(cells, box, cold=True) + self._flat(4 * cells, box, cold=True)
        if setup.has_block:
            total += self.speed.arrays * (_CHECK_BODY + _CHECK_BODY_CELL * cells)
        return total + (self.step() if setup.uses_laws else 0.0)

    def estimate(self) -> float:
        """Return the time of estimating the plane at the largest load before the run."""
        if not self._free:
            return 0.0
        if self.on_cells and not self.setup.uses_laws:
            cells = min(self.cells, _ESTIMATE_CELLS**2)
            return self._flat(cells, Box(), cold=True, free=True, on_half_space=True)
        if self.setup.samples:
            return self._flat(_ESTIMATE_CELLS**2, Box(), cold=True, free=True, on_half_space=True)
        if self.on_cells:
            return self._flat(self.cells, self.boxes[-1], cold=True, free=True, on_half_space=True)
        return 2.0 * self.step()

    def _flat(
        self,
        cells: float,
        box: Box,
        *,
        cold: bool = False,
        free: bool = False,
        on_half_space: bool = False,
        more: float = 1.0,
    ) -> float:
        """Return the time of a solution without finite slopes on some cells of the surface."""
        part = box.part * cells
        each = (_DOUBLE + _SINGLE * box.rows) * self._product(part)
        if self.setup.has_block and not (on_half_space or self.setup.samples):
            each += self.speed.arrays * (_BODY_PRODUCT + _BODY_CELL * part)
        work = more * (_FEW + _MANY * box.rows) * self.products(cells) * each
        work *= (_FROM_COARSE if cold else 1.0) * (_FREE_MOTIONS if free else 1.0)
        besides = self.speed.arrays * (_OVERHEAD + _SIZE_OVERHEAD * cells)
        return work + besides + self._product(cells)

    def _product(self, cells: float) -> float:
        """Return the time of a product in double precision on some cells."""
        periodic = self.setup.scene.surface.periodic or bool(self.setup.samples)
        return (_PERIODIC if periodic else 1.0) * self.speed.product(cells)

    def _sloped(self, cells: float, box: Box, *, free: bool = False) -> float:
        """Return the time of a solution with finite slopes, for as many passes as they take."""
        coarse = min(cells / _SLOPES_LEAST, 1.0) * _SLOPES_COARSE
        large = max(cells / _SLOPES_CACHED, 1.0) ** _SLOPES_GROWTH
        each = _PASS + coarse + (_PASS_CELL + _SLOPES_CELL * large) * cells
        each *= self.speed.arrays
        return _PASSES * each + self._flat(cells, box, free=free, more=_SLOPES)

    def _of_summits(self, summits: int) -> float:
        """Return the time of a solution of so many summits, which interact each with each."""
        return self.speed.arrays * (1.0e-3 + 13e-6 * summits + 28e-9 * summits**2)
