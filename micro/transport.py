"""What flows through a contact: fluids through its gaps, heat and current through its spots.

Fluids obey Reynolds' equation, ∇·(g³/(12 η) ∇P) = 0 between two opposite sides, in finite volumes
on the cells of a map of gaps. Between neighbours lies the harmonic mean of their g³, as half of the
way between their centres leads through each. Cells in contact are closed.

Conductances follow from the stiffness, by Barber's analogy: the temperature of a conducting
half-space under the heat flow through its contacts obeys the same potential problem as its
displacement under an increment of load. Contacts between half-spaces of the conductivities k₁ and
k₂ conduct

    G = 2 / (1/k₁ + 1/k₂) · (dF/dδ) / E*,

and per area h = 2 / (1/k₁ + 1/k₂) · (dp/dc) / E*. A body that conducts far better than the other
drops out of the sum. A circular spot of radius a on an isothermal plane, dF/dδ = 2 E* a, conducts
4 k a. The analogy is exact for spots on half-spaces, whatever their shape and mutual distance.

Theory: docs/theory.md, sections 14 and 16.

Source:
    Patir & Cheng 1978, doi 10.1115/1.3453103 (flow factors); Dapp, Lücke, Persson & Müser 2012,
    doi 10.1103/PhysRevLett.108.244301 (leak and percolation); Barber 2003, Proc. R. Soc. A 459,
    53-66, doi 10.1098/rspa.2002.1038 (conductance).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.micro.gap_cells import (
    WidestPath,
    cell_links,
    cell_network,
    joined_pools,
    link_ends,
    turned,
)
from patchlaw.support import Array, InputError
from patchlaw.support.network import banded, network_flow

_LEAST_GAP = 1e-7
"""Gap over the largest one that counts as closed. Solutions of the contact problem know no smaller
ones, and the flow through it is 1e-21 of that through the largest."""


_MOST_FACTORISED, _THIN = 72**2, 8
"""Square of the cells along the shorter side up to which maps are factorised: flows along both axes
took 20, 34 and 51 ms of CPU so on 64², 80² and 96² cells, at 2 % contact, and 21, 30 and 32 ms by
multigrid. And how many times as many along the other side: those of thin maps, halved as often as
their long side, would be filled up to many times their number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Constriction:
    """The narrowest place on the widest path.

    Args:
        place: Centre (x, y) of the cell there [mm].
        gap: Gap of that cell [mm].
        share: Part of the whole flow that passes through its channel.
    """

    place: tuple[float, float]
    gap: float
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class GapFlow:
    """The flow through a map of gaps from the side x = 0 to the opposite one, or along y.

    Args:
        gap: Gaps of the cells, 0 where closed, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
        axis: 0 for a flow along x, 1 along y.
        periodic: Whether the map continues over the two sides along the flow.
        total: Flow between fluid pressures of 1 and 0 at the sides [mm³].
        pressure: Fluid pressure, 1 at the first side and 0 at the other, NaN in contact and where
            no path from a side leads, shape (nx, ny). On large maps in pools off the way of the
            flow, which it hardly changes, it may err by some hundredths.
    """

    gap: Array
    lengths: tuple[float, float]
    axis: int
    periodic: bool
    total: float
    pressure: Array

    @property
    def percolates(self) -> bool:
        """Whether an open path leads from side to side."""
        return self.total > 0.0

    @property
    def transmissivity(self) -> float:
        """T = 12 η Q L/(W ΔP) of the flow Q through the width W along the length L [mm³]."""
        along, across = self.lengths[self.axis], self.lengths[1 - self.axis]
        return self.total * along / across

    @property
    def hydraulic_gap(self) -> float:
        """Gap between parallel plates that lets as much through, T^(1/3) [mm]."""
        return float(np.cbrt(self.transmissivity))

    @property
    def flow_factor(self) -> float:
        """Flow factor φ = T/ḡ³ of the mean gap ḡ; 0 without a gap.

        Source: Patir & Cheng 1978, doi 10.1115/1.3453103.
        """
        mean = float(self.gap.mean())
        return self.transmissivity / mean**3 if mean else 0.0

    def rate(self, drop: float, viscosity: float) -> float:
        """Return the flow rate Q [mm³/s].

        Args:
            drop: Fluid pressure at the first side less that at the other [MPa].
            viscosity: Dynamic viscosity η [MPa s].
        """
        return self.total * drop / (12.0 * viscosity)

    @property
    def flux(self) -> tuple[Array, Array]:
        """Flow per width along x and y at the centres of cells, shapes (nx, ny).

        1 is that between parallel plates at the mean gap.
        """
        gap, (length, width) = turned(self.gap, self.lengths, self.axis)
        pressure = np.pad(turned(self.pressure, self.lengths, self.axis)[0], ((1, 1), (0, 0)))
        pressure[0] = 1.0
        links = cell_links(gap**3, (length, width), periodic=self.periodic)
        along, across = (  # 0 in pools that no path from a side leads to
            np.nan_to_num(link * (tail - head), copy=False)
            for link, (tail, head) in zip(links, link_ends(pressure), strict=True)
        )
        plates = float(self.gap.mean()) ** 3 / length
        # each cell has the mean of what passes through two opposite faces
        first = 0.5 * (along[:-1] + along[1:]) / (width / across.shape[1] * plates)
        second = 0.5 * (across + np.roll(across, 1, axis=1)) / (length / len(across) * plates)
        return (second.T, first.T) if self.axis else (first, second)

    @cached_property
    def constriction(self) -> Constriction | None:
        """The critical constriction; None where nothing flows.

        What passes through its channel is seen along the line of equal fluid pressure through it,
        from contact to contact.
        """
        if not self.percolates:
            return None
        path = WidestPath(self.gap, self.lengths, self.axis, periodic=self.periodic)
        narrowest, shape = path.narrowest(), self.gap.shape
        assert narrowest is not None, "fluid flows along some path"
        ends, _ = narrowest
        pressure, gap = np.append(self.pressure, (1.0, 0.0)), np.append(self.gap, (np.inf, np.inf))
        cell = int(min(ends, key=gap.item))
        above = pressure > pressure[ends].mean()
        cells = above[:-2].reshape(shape)
        (tail, head), link = path.links([cells[:-1] != cells[1:], cells[:, :-1] != cells[:, 1:]])
        flow = np.nan_to_num(np.abs(link * (pressure[tail] - pressure[head])))
        flow[above[tail] == above[head]] = 0.0
        beside = np.zeros(len(above), bool)  # all cells of a side are joined by its terminal
        beside[tail[flow > 0.0]] = beside[head[flow > 0.0]] = True
        pools, count = path.pools(beside[:-2].reshape(shape))
        if self.periodic:
            over = joined_pools(pools[:-2].reshape(shape), count, 1 - self.axis)
            pools = over[pools]
        channel = beside & (pools == pools[cell])
        channel[-2:] = False
        share = math.fsum(flow[channel[tail] | channel[head]])  # the same in any order
        place = np.add(np.divmod(cell, shape[1]), 0.5) * self.lengths / shape
        return Constriction(
            place=(float(place[0]), float(place[1])),
            gap=float(gap[cell]),
            share=min(share / self.total, 1.0),
        )


def gap_flow(
    gap: Array, lengths: tuple[float, float], *, axis: int = 0, periodic: bool = False
) -> GapFlow:
    """Solve Reynolds' equation on a map of gaps.

    Args:
        gap: Gaps of the cells, 0 in contact, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
        axis: 0 for a flow from x = 0 to x = Lx, 1 along y.
        periodic: Whether the map continues over the two sides along the flow, which are walls
            otherwise.

    Raises:
        InputError: When the gaps are no numbers ≥ 0 of at least two cells a side.
        NotConverged: When what enters and leaves the cells does not balance.
    """
    return gap_flows(gap, lengths, axes=(axis,), periodic=periodic)[0]


def gap_flows(
    gap: Array,
    lengths: tuple[float, float],
    *,
    axes: Sequence[int] = (0, 1),
    periodic: bool = False,
    tolerance: float = 1e-7,
) -> list[GapFlow]:
    """Solve Reynolds' equation for flows along several axes, which takes less than one by one.

    Args:
        gap: See `gap_flow`.
        lengths: Likewise.
        axes: 0 for a flow along x, 1 along y.
        periodic: See `gap_flow`.
        tolerance: Error of the flows that does no harm, relative to them.

    Raises:
        InputError: See `gap_flow`.
        NotConverged: Likewise.
    """
    gap = np.asarray(gap, float)
    if gap.ndim != 2 or min(gap.shape) < 2:
        raise InputError("is no map of gaps", value=gap.shape, allowed="cells along x and y")
    if not (np.isfinite(gap).all() and (gap >= 0.0).all()):
        raise InputError("gaps must be finite numbers ≥ 0", allowed="0 in contact")
    open_gap = open_gaps(gap, gap.max())
    found = None
    shorter, longer = sorted(gap.shape)
    if shorter**2 > _MOST_FACTORISED and longer <= _THIN * shorter:
        from patchlaw.micro.gap_iteration import cell_flows  # small maps do without

        found = cell_flows(open_gap, lengths, axes, periodic=periodic, tolerance=tolerance)
    if found is None:
        found = [_factorised_flow(open_gap, lengths, axis, periodic) for axis in axes]
    return [
        GapFlow(
            gap=open_gap,
            lengths=lengths,
            axis=axis,
            periodic=periodic,
            total=total,
            pressure=pressure,
        )
        for axis, (pressure, total) in zip(axes, found, strict=True)
    ]


def _factorised_flow(
    gap: Array, lengths: tuple[float, float], axis: int, periodic: bool
) -> tuple[Array, float]:
    """Return fluid pressures of cells, shape (nx, ny), and the flow, by a factorisation."""
    along, sides = turned(gap, lengths, axis)
    solution = network_flow(cell_network(along**3, sides, periodic=periodic), banded)
    pressure = solution.potential[:-2].reshape(along.shape)
    return (pressure.T if axis else pressure), solution.total


def open_gaps(gap: Array, largest: float) -> Array:
    """Return gaps, 0 where they are so small that they count as closed.

    Args:
        gap: Gaps of any shape [mm].
        largest: The largest gap of the surface that they belong to [mm].
    """
    return np.where(gap > _LEAST_GAP * largest, gap, 0.0)


def widened_gap(gap: Array, *, periodic: bool) -> Array:
    """Return gaps whose contact ends half a cell earlier on all sides, beside walls a whole cell.

    Cells in contact or beside it take the mean of their own gap and the widest of their neighbours.
    On the sides of a map that is not periodic they take the widest: a channel between contact and
    wall may lie within the half of a cell beyond the last centres.

    Args:
        gap: Gaps of the cells, 0 in contact, shape (nx, ny) [mm].
        periodic: Whether the map continues over its sides.
    """
    around = np.pad(gap, 1, mode="wrap" if periodic else "edge")
    along, across = around[:, 1:-1], around[1:-1]
    cells = np.stack([gap, along[:-2], along[2:], across[:, :-2], across[:, 2:]])
    at_contact = cells.min(axis=0) <= _LEAST_GAP * gap.max()
    part = np.full(gap.shape, 0.5)
    if not periodic:
        part[[0, -1]] = part[:, [0, -1]] = 1.0
    return np.where(at_contact, gap + part * (cells.max(axis=0) - gap), gap)


Number = TypeVar("Number", float, Array)

STEFAN_BOLTZMANN = 5.670374419e-8
"""Constant of heat radiation [W/m²/K⁴]; CODATA 2018."""
_MM_PER_M = 1e3


def pair_conductivity(conductivities: Sequence[float]) -> float:
    """Return 1/(1/k₁ + 1/k₂), or k of the one body that resists.

    Args:
        conductivities: Of both bodies, or of the one on a body that conducts far better
            [W/m/K or S/m].

    Raises:
        InputError: When there are not one or two, or one is not positive.
    """
    values = [float(value) for value in conductivities]
    if len(values) not in (1, 2) or not all(np.isfinite(k) and k > 0.0 for k in values):
        raise InputError(
            "the conductivities of a contact do not fit",
            value=values,
            allowed="one or two, each > 0",
        )
    return 1.0 / sum(1.0 / k for k in values)


def total_conductance(stiffness: Number, contact_modulus: float, conductivity: float) -> Number:
    """Return the conductance of contacts [W/K or S].

    Args:
        stiffness: Interfacial stiffness dF/dδ on half-spaces [N/mm].
        contact_modulus: E* [MPa].
        conductivity: See `pair_conductivity` [W/m/K or S/m].
    """
    return 2.0 * conductivity / contact_modulus * stiffness / _MM_PER_M


def conductance_per_area(stiffness: Number, contact_modulus: float, conductivity: float) -> Number:
    """Return the conductance per area of an interface with a law [W/m²/K or S/m²].

    Args:
        stiffness: Stiffness dp/dc of the law [MPa/mm].
        contact_modulus: E* [MPa].
        conductivity: See `pair_conductivity` [W/m/K or S/m].
    """
    return 2.0 * conductivity / contact_modulus * stiffness * _MM_PER_M


def gas_conductance(gap: ArrayLike, conductivity: float, temperature_jump: float = 0.0) -> float:
    """Return the conductance per area of the gas in gaps, the mean of k/(g + M) [W/m²/K].

    Heat passes straight through the gas. Where there is no gap, contacts conduct by themselves.
    Gaps close as the power 3/2 of the distance from a contact: without a temperature jump the
    integral has no bound there, and the sum over cells grows with their number.

    Args:
        gap: Gaps g of equal parts of the area, of any shape, 0 in contact [mm].
        conductivity: k of the gas [W/m/K].
        temperature_jump: Length M that the jumps of temperature at both faces add to the gap, a few
            mean free paths [mm].

    Source:
        Yovanovich 2005, doi 10.1109/TCAPT.2005.848483.
    """
    gap = np.asarray(gap, float)
    is_open = gap > _LEAST_GAP * gap.max()  # first touches leave gaps of rounding
    added = np.divide(1.0, gap + temperature_jump, out=np.zeros(gap.shape), where=is_open)
    return _MM_PER_M * conductivity * float(added.mean())


def radiation_conductance(temperature: float, emissivity: float) -> float:
    """Return the conductance per area of radiation across a gap, 4 ε σ T³ [W/m²/K].

    Args:
        temperature: Absolute temperature of both faces T [K].
        emissivity: Effective emissivity ε of both faces, 1/(1/ε₁ + 1/ε₂ − 1).
    """
    return 4.0 * emissivity * STEFAN_BOLTZMANN * temperature**3
