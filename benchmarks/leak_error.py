"""How well coarser grids, and next to closing wider gaps, tell the error of a leak.

Surfaces, periodic or not, of 32² to 48² cells, 5 to 16 of them along the shortest wave, each under
two loads of 2 to 60 % contact area. The true leak is that on four times as many cells a side.
``--closing`` judges flows between walls under the loads just before and beyond that which closes
them along x, ``--rows`` the tables of periodic samples, errors by grid and rows together, and
``--scatter`` the mean of a few samples against that of sixty of a spectrum, and ``--lay`` the same
of ridges along y. Run from the project's root; a surface takes 2 s, a spectrum a minute:

    .venv/bin/python benchmarks/leak_error.py --first 0 --last 100 [--closing | --rows | --scatter]
"""

import argparse
from itertools import pairwise, product

import numpy as np
from scipy.special import stdtrit

from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flows, widened_gap
from patchlaw.multiscale.laws.rows import Transmissivity
from patchlaw.multiscale.laws.transmissivity import (
    _scatter,
    error_of_grid,
    next_to_closing,
    sample_transmissivity,
)

AREAS = (0.0, 0.05, 0.15, 0.25, 0.35, 1.0)
"""Borders of the contact area fraction between rows of the table."""
MODULUS = 1000.0
LOADS = 0.02, 0.05, 0.1, 0.15, 0.2, 0.24, 0.28, 0.31, 0.34, 0.37, 0.4, 0.44, 0.5
"""Mean pressures over half of the rms slope times the modulus."""


def flows(seed):
    """Return rows of contact area, T, that on half of the cells, stated and true error."""
    dice = np.random.default_rng(seed)
    cells, periodic = int(dice.choice([32, 40, 48])), bool(dice.random() < 0.5)
    low = dice.uniform(1, 2)
    waves = low, dice.uniform(max(low + 1, cells / 16), cells / 5)
    hurst, slope = dice.uniform(0.4, 1.0), 10.0 ** dice.uniform(-2.0, -0.7)
    spectrum = Spectrum(hurst=hurst, waves=waves, rms_slope=slope, seed=int(dice.integers(2**31)))
    surface = synthesise(spectrum, grid=(4 * cells, 4 * cells), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=periodic, tolerance=1e-6)

    def through(gap):
        return [one.transmissivity for one in gap_flows(gap, (1.0, 1.0), periodic=periodic)]

    rows = []
    for share in dice.uniform(0.02, 0.6, 2):
        found = []
        for count in (cells // 4, cells // 2, cells, 4 * cells):
            state = model.resampled((count, count)).solve_force(0.5 * share * slope * MODULUS)
            found.append(through(state.open_gap))
            if count == cells:
                area = state.contact_area_fraction
                wider = through(widened_gap(state.open_gap, periodic=periodic))
        quarter, half, own, true = np.array(found)
        stated = error_of_grid(own, half, quarter, wider)
        rows += zip([area] * 2, own, half, stated, np.abs(own - true), true, strict=True)
    return np.array(rows)


def at_closing(seed):
    """Return rows of T, its stated and true error, and whether it is next to closing."""
    dice = np.random.default_rng([79, seed])
    cells, low = int(dice.choice([32, 40, 48])), dice.uniform(1, 2)
    waves = low, dice.uniform(low + 1, max(low + 1.01, cells / 8))
    hurst, slope = dice.uniform(0.4, 1.0), 10.0 ** dice.uniform(-2.0, -0.7)
    spectrum = Spectrum(hurst=hurst, waves=waves, rms_slope=slope, seed=int(dice.integers(2**31)))
    surface = synthesise(spectrum, grid=(4 * cells, 4 * cells), lengths=(1.0, 1.0))
    finest = HalfSpaceModel(surface, contact_modulus=MODULUS, tolerance=1e-6)
    models = [finest.resampled((cells // k, cells // k)) for k in (4, 2, 1)]

    def pressed(model, share):
        return model.solve_force(0.5 * share * slope * MODULUS).open_gap

    def through(gap):
        return np.array([flow.transmissivity for flow in gap_flows(gap, (1.0, 1.0))])

    low, high, rows = 0.02, 0.7, []
    if through(pressed(models[2], high))[0] > 0.0:
        return np.zeros((0, 4))
    for _ in range(6):
        middle = 0.5 * (low + high)
        is_open = through(pressed(models[2], middle))[0] > 0.0
        low, high = (middle, high) if is_open else (low, middle)
    for share in (low, high):
        quarter, half, own = (through(pressed(model, share)) for model in models)
        wider = through(widened_gap(pressed(models[2], share), periodic=False))
        off = np.abs(own - through(pressed(finest, share)))
        stated = error_of_grid(own, half, quarter, wider)
        rows += zip(own, stated, off, next_to_closing(own, half, quarter), strict=True)
    return np.array(rows)


def of_rows(seed):
    """Return the stated and the true errors of a sample's table."""
    dice = np.random.default_rng([52, seed])
    cells, low = int(dice.choice([32, 40, 48])), dice.uniform(1, 2)
    waves = low, dice.uniform(max(low + 1, cells / 16), cells / 5)
    slope = 10.0 ** dice.uniform(-2.0, -0.7)
    hurst, number = dice.uniform(0.4, 1.0), int(dice.integers(2**31))
    spectrum = Spectrum(hurst=hurst, waves=waves, rms_slope=slope, seed=number)
    surface = synthesise(spectrum, grid=(4 * cells, 4 * cells), lengths=(1.0, 1.0))
    finer = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=True, tolerance=1e-6)
    table = sample_transmissivity([finer.resampled((cells, cells))], np.zeros_like)
    closed, touch = table.separation[[0, -1]]
    rows, flat = [], finer.reference_height - surface.mean_height
    for part in dice.uniform(0.0, 1.0, 6) ** 2:
        at = np.array([0.7 * closed + (touch - 0.7 * closed) * part])
        gap = finer.press(Control(approach=flat - at[0])).open_gap
        own = table.at(at)[0]
        stated = sum(np.abs(table.varied(cause, at)[0] - own) for cause in ("grid", "rows"))
        for axis, flow in enumerate(gap_flows(gap, (1.0, 1.0), periodic=True)):
            rows.append((stated[axis], abs(own[axis] - flow.transmissivity)))
    return rows


def of_scatter(seed, lay=False):
    """Return counts of samples, contact area, direction and whether the error of their mean holds.

    The tables of a few samples are judged under the same mean pressures by that of sixty.
    """
    dice = np.random.default_rng([54, seed])
    low = dice.uniform(1, 3)
    waves, hurst = (low, dice.uniform(low + 1, 6.4)), dice.uniform(0.4, 1.0)
    bands = {"waves_x": (low, min(waves[1], 5.9)), "waves_y": (1, 1.2)} if lay else {"waves": waves}
    slope, models = 10.0 ** dice.uniform(-2.0, -0.7), []
    for _ in range(60):
        number = int(dice.integers(2**31))
        spectrum = Spectrum(hurst=hurst, **bands, rms_slope=slope, seed=number)
        surface = synthesise(spectrum, grid=(32, 32), lengths=(1.0, 1.0))
        models.append(
            HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=True, tolerance=1e-6)
        )
    loads = 0.5 * np.array(LOADS) * slope * MODULUS
    flat = [model.reference_height - model.surface.mean_height for model in models]
    pressed = [[model.solve_force(load).approach for load in loads] for model in models[:6]]
    touch = max(one - model.first_touch for one, model in zip(flat, models, strict=True))
    separation = np.mean(np.array(flat[:6])[:, None] - pressed, axis=0)
    separation = np.array([touch, 0.5 * (touch + separation[0]), *separation])
    found = np.array([row_by_row(*one, separation) for one in zip(models, flat, strict=True)])
    areas = found[:, 2:, 3].mean(axis=0)
    all_pressures, all_flows = found[..., 2].mean(axis=0), found[..., :2].mean(axis=0)
    rows, choose = [], np.random.default_rng(seed)
    for count in (2, 3, 5) * 20:
        some = found[choose.choice(60, count, replace=False)]
        flow, pressure = some[..., :2].mean(axis=0), some[..., 2].mean(axis=0)
        stops = [min(int(np.argmin(one[:, :2].any(axis=1))) or len(one), len(one)) for one in some]
        for one, stop in zip(some, stops, strict=True):
            one[stop + 1 :, 2] = np.nan  # as laws know no pressures of closed samples
        gap = np.cbrt(flow)
        apart = _scatter(some[..., :3], np.full(count, 1.0 / count), pressure)[:, None]
        kept = slice(min(max(stops), len(flow) - 1), None, -1)  # with one closed row
        table = Transmissivity(
            separation=separation[kept],
            hydraulic_gap=gap[kept],
            on_half=gap[kept],
            scatter=((gap + apart) ** 3 - gap**3)[kept],
        )
        for load, area in zip(loads, areas, strict=True):
            at = np.interp(load, pressure[1:], separation[1:], left=touch)[None]
            own, share = table.at(at)[0], stdtrit(2 * (count - 1), 0.975) / np.sqrt(count)
            stated = table.varied("samples", at, share)[0] - own
            true = [np.interp(load, all_pressures, np.cbrt(one)) ** 3 for one in all_flows.T]
            rows += [
                (count, area, axis, abs(a - b) <= 1.5 * c)
                for axis, (a, b, c) in enumerate(zip(own, true, stated, strict=True))
            ]
    return rows


def row_by_row(model, flat, separations):
    """Return T along x and y, mean pressure and contact area of a sample, a row each."""
    rows, start = [], None
    for separation in separations:
        if flat - separation <= model.first_touch:
            heights, own = model.surface.heights - model.surface.mean_height, (0.0, 0.0)
            gap = np.maximum(separation - heights, 0.0)
        else:
            state = model.press(Control(approach=float(flat - separation)), start=start)
            start, gap, own = (
                state.guess,
                state.open_gap,
                (state.mean_pressure, state.contact_area_fraction),
            )
        flows = gap_flows(gap, (1.0, 1.0), periodic=True)
        rows.append([*(flow.transmissivity for flow in flows), *own])
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=100)
    parser.add_argument("--closing", action="store_true")
    parser.add_argument("--rows", action="store_true")
    parser.add_argument("--scatter", action="store_true")
    parser.add_argument("--lay", action="store_true")
    given = parser.parse_args()
    seeds = range(given.first, given.last)
    if given.closing:
        own, stated, off, closing = np.concatenate([at_closing(seed) for seed in seeds]).T
        held, hidden = off <= 1.5 * stated, (own == 0.0) & (off > 0.0)
        classes = {"all": own >= 0.0, "next to closing": closing > 0.0, "closed": own == 0.0}
        for name, some in {**classes, "closed, but open in truth": hidden}.items():
            print(f"{name}: {held[some].sum()} of {some.sum()} true errors within 1.5 × the stated")
        here = (closing > 0.0) & (own > 0.0)
        print(
            f"open next to closing: stated is {np.median(stated[here] / own[here]):.0f} × the leak"
        )
        return
    if given.rows:
        stated, off = np.concatenate([of_rows(seed) for seed in seeds]).T
        held, some = off <= 1.5 * stated, off > 0.0
        print(f"rows: {held.sum()} of {len(held)} true errors within 1.5 × the stated ones, which")
        print(f"are {np.median(stated[some] / off[some]):.1f} times the true ones in the median")
        return
    if given.scatter or given.lay:
        rows = np.concatenate([of_scatter(seed, given.lay) for seed in seeds])
        for count, axis in product((2, 3, 5), (0, 1)):
            held = rows[(rows[:, 0] == count) & (rows[:, 2] == axis), 3]
            print(f"{count} samples, along {'xy'[axis]}: {held.sum():.0f} of {len(held)}")
        for count in (2, 3, 5):
            for low, high in ((0.0, 0.1), (0.1, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 1.0)):
                here = (rows[:, 0] == count) & (rows[:, 1] >= low) & (rows[:, 1] < high)
                held = rows[here, 3]
                print(f"{count} samples, {low:g} to {high:g}: {held.sum():.0f} of {len(held)}")
        return
    table = np.concatenate([flows(seed) for seed in seeds])
    print(
        "contact area | flows | closed | true ≤ stated | true ≤ 1.5 × stated | by half alone | "
        "stated over true | stated over flow, median"
    )
    for low, high in (*pairwise(AREAS), (0.0, 1.0)):
        area, own, half, stated, off, true = table.T
        here = (area >= low) & (area < high)
        some = here & (own > 0.0) & (off > 0.0)
        print(
            f"{low:.2f} to {high:.2f} | {here.sum()} | {(here & (own == 0.0)).sum()}"
            f" | {np.mean((off <= stated)[here]):.3f} | {np.mean((off <= 1.5 * stated)[here]):.3f}"
            f" | {np.mean((off <= 1.5 * np.abs(own - half))[here]):.3f}"
            f" | {np.median(stated[some] / off[some]):.2f}"
            f" | {np.median(stated[some] / own[some]):.2f}"
        )
    for area, own, half, stated, _, true in table[table[:, 4] > 1.5 * table[:, 3]]:
        print(f"missed at {area:.3f}: {own:.3g} ± {stated:.2g}, half {half:.3g}, true {true:.3g}")


if __name__ == "__main__":
    main()
