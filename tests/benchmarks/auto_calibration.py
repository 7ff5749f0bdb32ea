"""Finds the coefficients of the expected errors and the costs of the micro models.

Run by hand, some minutes: python tests/benchmarks/auto_calibration.py [--rows FILE …] [--costs]

Every bound is the least weighted sum of non-negative terms that 97.5 % of the measured errors keep:
quantile regression (Koenker & Bassett 1978, doi 10.2307/1913643), solved as a linear programme.
Measurements are kept in the first FILE, or joined from all that exist.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from auto_surfaces import converged, forces, surfaces
from scipy.optimize import linprog

from geometry import Spectrum, Surface, synthesise
from geometry.errors import NotConverged
from micro import MODELS, micro_model
from micro.choice.expected_errors import (
    ContactMeasures,
    contact_measures,
    contact_terms,
    grid_terms,
)
from micro.choice.models import FACTORS, half_space

SCALED = {"curvature": "contact", "border": "include"}
KINDS = {**{name: (name, {}) for name in MODELS}, "scaled": ("elliptic", SCALED)}
KINDS["islands"] = ("islands", {})
CONTACT_TERMS = ("floor", "crowding", "eccentricity", "wave", "eccentric_wave", "border")
GRID_TERMS = ("radius_few", "radius", "wave")
FIELDS = list(ContactMeasures.__dataclass_fields__)


def errors(model, loads, truth):
    """Return the relative errors of the forces; infinite where there is no solution."""
    try:
        return np.abs(forces(model, loads) / truth - 1.0)
    except NotConverged:
        return np.full(len(truth), np.inf)


def models(surface):
    """Yield kind, relative cells along a side (0 without a grid) and model."""
    for kind, (name, chosen) in KINDS.items():
        yield kind, 0.0, micro_model(name, surface, contact_modulus=1.0, **chosen)
    for factor in FACTORS:
        n = round(factor * surface.grid[0])
        if 16 <= n <= 800:
            yield "half-space", factor, half_space(surface, (n, n), 1.0)


def measured(count, seed):
    """Return rows: kind, relative cells, measures, error, error of truth."""
    rows = []
    for surface, approach in surfaces(count, seed):
        loads = [0.5 * approach, approach]
        truth, own = converged(surface, loads)
        at = [contact_measures(surface, load) for load in loads]
        for kind, factor, model in models(surface):
            for where, error, sure in zip(at, errors(model, loads, truth), own, strict=True):
                values = [getattr(where, name) for name in FIELDS]
                rows.append((kind, factor, *values, error, sure))
    return rows


def quantile(terms, error, share=0.975):
    """Return the non-negative coefficients of a bound that a share of the errors keep.

    Errors weigh by the inverse of the bound of the pass before, so that small bounds count; weights
    by the errors themselves would shift the share.
    """
    n, m = terms.shape
    equal, bound = np.hstack([terms, np.eye(n), -np.eye(n)]), np.full(n, 0.1)
    for _ in range(6):
        weight = 1.0 / (bound + 0.005)
        cost = np.concatenate([np.zeros(m), share * weight, (1.0 - share) * weight])
        found = linprog(cost, A_eq=equal, b_eq=error, bounds=(0.0, None)).x[:m]
        bound = terms @ found
    return found


def fitted(rows):
    """Print coefficients and the share of bounds that held, of those below 20 %."""
    for kind in dict.fromkeys(row[0] for row in rows):
        mine = [row for row in rows if row[0] == kind and np.isfinite(row[-2])]
        error = np.array([row[-2] for row in mine])
        at = [ContactMeasures(**dict(zip(FIELDS, row[2:-2], strict=True))) for row in mine]
        if kind == "half-space":
            names, terms = GRID_TERMS, [grid_terms(a, r[1]) for a, r in zip(at, mine, strict=True)]
        else:
            names, terms = CONTACT_TERMS, [contact_terms(a) for a in at]
        terms = np.array(terms)
        found = quantile(terms, error)
        bound = terms @ found
        said = ", ".join(f"{n}: {c:.3g}" for n, c in zip(names, found, strict=True))
        print(f"{kind}: {said}")
        print(
            f"   {len(error)} errors, median {np.median(error):.2%}, bound {np.median(bound):.2%}"
        )
        for lo, hi in ((0.0, 0.02), (0.02, 0.05), (0.05, 0.1), (0.1, 0.2)):
            part = (bound > lo) & (bound <= hi)
            kept = np.mean((error <= bound)[part]) if part.any() else np.nan
            print(f"   bound {lo:.0%} to {hi:.0%}: {part.sum():4d} cases, kept {kept:.1%}")


def timed(surface, loads, name, chosen):
    """Return seconds to set up and per approach of a fresh model."""
    fresh = replace(surface)
    _ = fresh.highest
    start = time.perf_counter()
    model = micro_model(name, fresh, contact_modulus=1.0, **chosen)
    forces(model, loads[:1])
    middle = time.perf_counter()
    forces(model, loads)
    each = (time.perf_counter() - middle) / len(loads)
    return middle - start - each, each


def costs(repeats=4):
    """Print seconds to set up and per approach, minima of repeats, on grids of 64² to 512²."""
    for n in (64, 128, 256, 512):
        spectrum = Spectrum(hurst=0.8, waves=(2, n // 8), rms_slope=0.1, seed=1)
        made = synthesise(spectrum, grid=(n, n), lengths=(1.0, 1.0))
        surface = Surface(heights=made.heights, lengths=made.lengths)
        loads = np.linspace(0.5, 1.0, 6) * surface.heights.std()
        for kind, (name, chosen) in {**KINDS, "half-space": ("half-space", {})}.items():
            spent = [timed(surface, loads, name, chosen) for _ in range(repeats)]
            print(n, kind, *(f"{1e3 * t:.3g} ms" for t in np.min(spent, axis=0)), flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--surfaces", type=int, default=80)
    parser.add_argument("--seed", type=int, default=10_000)
    parser.add_argument("--rows", type=Path, nargs="*")
    parser.add_argument("--costs", action="store_true")
    given = parser.parse_args()
    if given.costs:
        costs()
        return
    rows = []
    for path in given.rows or []:
        rows += np.load(path, allow_pickle=True)["rows"].tolist() if path.exists() else []
    if not rows:
        rows = measured(given.surfaces, given.seed)
        if given.rows:
            np.savez(given.rows[0], rows=np.array(rows, dtype=object))
    fitted(rows)


if __name__ == "__main__":
    main()
