"""Finds the coefficients of the expected errors and the costs of the micro models.

Run by hand, some minutes: python tests/benchmarks/auto_calibration.py [--rows FILE] [--costs]

Every bound is the least weighted sum of non-negative terms that 97 % of the measured errors keep:
quantile regression (Koenker & Bassett 1978, doi 10.2307/1913643), solved as a linear programme. A
relative weight makes small errors count. Rows are kept in FILE, so that terms can be tried.
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
from micro.auto_candidates import FACTORS, half_space
from micro.auto_errors import CONTACT_TERMS, GRID_TERMS, contact_terms, grid_terms
from micro.auto_measures import ContactMeasures, contact_measures

SCALED = {"curvature": "contact", "border": "include"}
KINDS = {**{name: (name, {}) for name in MODELS}, "scaled": ("elliptic", SCALED)}
KINDS["islands"] = ("islands", {})
FIELDS = list(ContactMeasures.__dataclass_fields__)


def errors(model, loads, truth):
    """Return the relative errors of the forces; infinite where there is no solution."""
    try:
        return np.abs(forces(model, loads) / truth - 1.0)
    except NotConverged:
        return np.full(len(truth), np.inf)


def measured(count, seed):
    """Return rows: kind, factor of the grid, measures, error, error of truth."""
    rows = []
    for surface, approach in surfaces(count, seed):
        loads = [0.5 * approach, approach]
        truth, own = converged(surface, loads)
        at = [contact_measures(surface, load, periodic=False) for load in loads]
        models = [(k, 0.0, micro_model(n, surface, contact_modulus=1.0, **o)) for k, (n, o) in KINDS.items()]
        for factor in FACTORS:
            cells = (round(factor * surface.grid[0]),) * 2
            if max(cells) <= 800 and min(cells) >= 16:
                models.append(("half-space", factor, half_space(surface, cells, 1.0, False)))
        for kind, factor, model in models:
            for where, error, sure in zip(at, errors(model, loads, truth), own, strict=True):
                values = [getattr(where, name) for name in FIELDS]
                rows.append((kind, factor, *values, error, sure))
    return rows


def quantile(terms, error, share=0.97):
    """Return the non-negative coefficients of a bound that a share of the errors keep."""
    weight = 1.0 / (error + 0.01)
    n, m = terms.shape
    cost = np.concatenate([np.zeros(m), share * weight, (1.0 - share) * weight])
    equal = np.hstack([terms, np.eye(n), -np.eye(n)])
    return linprog(cost, A_eq=equal, b_eq=error, bounds=(0.0, None)).x[:m]


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
        low = bound <= 0.2
        said = ", ".join(f"{n}: {c:.3g}" for n, c in zip(names, found, strict=True) if c > 1e-6)
        print(f"{kind}: {said}")
        print(f"   {len(error)} errors, median {np.median(error):.2%}, 95 %: {np.quantile(error, 0.95):.1%}")
        for lo, hi in ((0, 0.02), (0.02, 0.05), (0.05, 0.1), (0.1, 0.2)):
            part = (bound > lo) & (bound <= hi)
            if part.any():
                print(f"   bound {lo:.0%} to {hi:.0%}: {part.sum():4d} cases, kept {np.mean((error <= bound)[part]):.1%}, within upper {np.mean((error <= hi)[part]):.1%}")


def costs():
    """Print seconds to set up and per approach, minima of repeats, on grids of 64² to 512²."""
    for n in (64, 128, 256, 512):
        spectrum = Spectrum(hurst=0.8, waves=(2, n // 8), rms_slope=0.1, seed=1)
        made = synthesise(spectrum, grid=(n, n), lengths=(1.0, 1.0))
        surface = Surface(heights=made.heights, lengths=made.lengths)
        loads = np.linspace(0.5, 1.0, 6) * surface.heights.std()
        kinds = {**KINDS, "half-space": ("half-space", {})}
        for kind, (name, chosen) in kinds.items():
            spent = []
            for _ in range(3):
                start = time.perf_counter()
                fresh = replace(surface)
                _ = fresh.highest
                middle = time.perf_counter()
                model = micro_model(name, fresh, contact_modulus=1.0, **chosen)
                forces(model, loads[:1])
                first = time.perf_counter()
                forces(model, loads)
                end = time.perf_counter()
                each = (end - first) / len(loads)
                spent.append((first - middle - each, each))
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
