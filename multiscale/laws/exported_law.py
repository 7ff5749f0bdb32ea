"""What is exported of a law: where it holds, rows with straight lines between, a Python module.

Names of places are plain ASCII, which every program reads.

The module needs nothing else and holds the interpolant itself.
4C's `CoConstLaw_python_surrogate` imports a module and calls ``evaluate(gap, offset)`` and
``evaluate_derivative(gap, offset)`` at the nodes where ``gap + offset`` ≤ 0. Both returns follow
its other laws: a pressure in compression is negative, and the derivative is that over the gap.

Its functions stand below, and are copied as they are, with `ROWS` and `PIECES` of the law.
"""

from __future__ import annotations

import inspect
import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator
from hashlib import sha256
from typing import NamedTuple

import numpy as np
import scipy

from patchlaw.geometry import Regions
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw, repaired_law
from patchlaw.support import Array, Indices, InputError

Conducts = Callable[[Array], dict[str, Array]]
"""From stiffnesses dp/dc [MPa/mm] to conductances per area by the name of their column."""

LEAST_PRESSURE = 0.01
"""Pressures below this part of the law's largest count as that much in relative errors."""
_FITTED = 400
"""Points on a law that rows of rising slope are fitted to; errors are told from many more."""


class Place(NamedTuple):
    """A law of a table, and where it holds.

    Attributes:
        law: The law.
        kind: ``"patch"`` or ``"region"``.
        label: What names of files and interactions end with: letters, digits and underscores.
        subject: The patch or region, as prose.
        extent: The rectangle of a patch; a region, which may be of any outline, has none.
        cells: What says in a row of a table where the law holds.
    """

    law: PatchLaw
    kind: str
    label: str
    subject: str
    extent: str
    cells: tuple[int | str, ...]


def places(table: LawTable) -> Iterator[Place]:
    """Yield the laws and their places, in their order.

    Regions keep their names where these make different labels, and are numbered otherwise.

    Args:
        table: The laws.
    """
    if isinstance(table.patches, Regions):
        names = table.patches.names
        labels = [re.sub(r"\W+", "_", plain(name).replace("?", " ")).strip("_") for name in names]
        short = [label[:40].lower() for label in labels]
        if not all(short) or len(set(short)) < len(short):
            short = [str(index) for index in range(len(names))]
        for law, name, label in zip(table.laws, names, short, strict=True):
            yield Place(law, "region", label, f"region '{plain(name)}'", "", (name,))
        return
    for index, law in enumerate(table.laws):
        (ix, iy), (x, y) = table.patches.unravel(index), table.patches.bounds(index)
        extent = f"{x[0]:.9g} < x < {x[1]:.9g}, {y[0]:.9g} < y < {y[1]:.9g} [mm]"
        yield Place(law, "patch", f"{ix}_{iy}", f"patch ({ix}, {iy})", extent, (ix, iy))


def made_by(table: LawTable) -> str:
    """Return how laws were made, on one line; nothing where they do not say so."""
    how = plain(", ".join(f"{name} {value}" for name, value in table.made_by.items()))
    return how and f"Made by: {how}"


def zero_text(table: LawTable) -> str:
    """Return what the closures of laws count from, as prose."""
    named = {
        "first touch": "the highest point of the roughness",
        "mean plane": "the mean of the heights of the roughness",
    }
    return named.get(table.zero, f"the {table.zero} of the heights of the roughness")


def plain(text: str) -> str:
    """Return a text that can stand in comments and docstrings: ASCII on one line, no quotes."""
    ascii_text = text.encode("ascii", "replace").decode().replace("\\", "/").replace('"', "'")
    return " ".join(ascii_text.split())


class LawSample(NamedTuple):
    """Rows of a law in the range where its pressure is a function of closure.

    Attributes:
        approach: Local approaches of the rows, ascending, shape (m,) [mm].
        closure: Closures, strictly ascending; the first is that of first touch, shape (m,) [mm].
        pressure: Pressures, strictly ascending from zero, shape (m,) [MPa].
        error: Largest difference between straight lines through the rows and the law, relative to
            the pressure, or to `LEAST_PRESSURE` of the largest where that is more.
        repair: Largest change that made falling pressures rise, relative to the largest pressure.
        convex: Whether the slope falls nowhere from row to row.
    """

    approach: Array
    closure: Array
    pressure: Array
    error: float
    repair: float
    convex: bool = True


def no_function(subject: str) -> InputError:
    """Return the error of a law that contact programs cannot take."""
    problem = f"the pressure of {subject} is no function of closure from first touch on"
    return InputError(problem, allowed="csv, or consistent laws, or larger patches")


def sample_law(
    law: PatchLaw,
    tolerance: float,
    most: int | None = None,
    *,
    convex: bool = False,
    subject: str = "the law",
) -> LawSample:
    """Choose rows on a law, as far apart as a tolerance lets them be.

    A row follows the one before it at the largest distance at which the chord is within the
    tolerance; rows lie on the law unless they may leave it. Contact programs take tables that rise;
    where a consistent law falls, because neighbours take load over, the nearest rising one is
    sampled, and the error counts the change.

    Args:
        law: The law. A patch that stays open has no rows.
        tolerance: Largest error, as in `LawSample`.
        most: Rows at most; the tolerance is raised until they suffice.
        convex: Whether rows may leave the law so that their slope falls nowhere, and few rows err
            less: by no more than the tolerance, or than the error of the law's own interpolation.
            Slopes of elastic contact rise, those of interpolants through its rows waver.
        subject: What errors call the patch or region.

    Raises:
        InputError: When the pressure is a function of closure nowhere.
    """
    if not law.rows.pressure.any():
        nothing = np.zeros(0)
        return LawSample(nothing, nothing, nothing, 0.0, 0.0)
    rising = repaired_law(law)
    if law.is_flat or rising.is_flat:
        raise no_function(subject)
    approach, closure, pressure = _candidates(rising)
    scale = np.maximum(pressure, LEAST_PRESSURE * pressure[-1])
    scale *= 0.98  # errors exceed those at the candidates by the rest
    chosen, asked = _chords(closure, pressure, tolerance * scale), tolerance
    if most is not None and len(chosen) > most:
        low, tolerance = tolerance, 1e3  # of one chord
        while tolerance > 1.02 * low:
            middle = math.sqrt(low * tolerance)
            fewer = _chords(closure, pressure, middle * scale)
            if len(fewer) > most:
                low = middle
            else:
                tolerance, chosen = middle, fewer
    rows, on_law = closure[chosen], _strictly_rising(pressure[chosen])
    best, error, rises = on_law, _error(law, closure, rows, on_law), _is_convex(rows, on_law)
    if convex and not (rises and error <= asked):
        near = _convex(closure, pressure, scale, chosen)
        change = _error(law, closure, rows, near)
        if change <= max(tolerance, law.interpolation_error):
            best, error, rises = near, change, True
    return LawSample(approach[chosen], rows, best, error, max(rising.repaired, law.repaired), rises)


def _is_convex(closure: Array, pressure: Array) -> bool:
    """Return whether the slope falls nowhere from row to row, but for rounding."""
    slope = np.diff(pressure) / np.diff(closure)
    return bool(np.all(slope[1:] >= slope[:-1] * (1.0 - 1e-9)))


def _convex(x: Array, y: Array, scale: Array, rows: Indices) -> Array:
    """Return pressures at rows whose slope rises, at the least largest error.

    They are a sum of ramps that begin at the rows: a linear program for their slopes.

    Args:
        x: Closures of points on the law.
        y: Pressures there.
        scale: What errors count relative to.
        rows: Indices of the rows among the points.
    """
    spread = np.linspace(0, len(x) - 1, _FITTED).astype(np.intp)
    at, unit = np.union1d(spread, rows), y[-1] / (x[-1] - x[0])
    ramps = np.maximum(x[:, None] - x[rows[:-1]], 0.0) * unit
    fit, aim = ramps[at] / scale[at, None], y[at] / scale[at]
    largest = -np.ones((len(at), 1))
    least = np.full(len(rows) - 1, 1e-7)  # more than rounding of the numbers that are written
    least[0] = 0.5 * y[rows[1]] / (x[rows[1]] - x[0]) / unit
    found = scipy.optimize.linprog(
        np.append(np.zeros(len(least)), 1.0),
        A_ub=np.block([[fit, largest], [-fit, largest]]),
        b_ub=np.append(aim, -aim),
        bounds=[*((one, None) for one in least), (0.0, None)],
        method="highs",
    )
    slopes = least if found.x is None else found.x[:-1]  # the error tells
    return np.asarray(ramps[rows] @ slopes)


def _candidates(law: PatchLaw) -> tuple[Array, Array, Array]:
    """Return approaches, closures and pressures on the law, closures strictly ascending."""
    knots = law.rows.approach[: law.rising_rows]
    # most where the pressure grows as the power 3/2
    first = np.linspace(0.0, 1.0, 1024, endpoint=False) ** 2
    steps = np.linspace(0.0, 1.0, 128, endpoint=False)
    within = knots[1:-1, None] + np.diff(knots[1:])[:, None] * steps
    begun = knots[0] + (knots[1] - knots[0]) * first
    approach = np.concatenate((begun, within.ravel(), knots[-1:]))
    point = law.along(approach)
    ascends = np.append(True, point.closure[1:] > np.maximum.accumulate(point.closure)[:-1])
    return approach[ascends], point.closure[ascends], point.pressure[ascends]


def _chords(x: Array, y: Array, allowed: Array) -> Indices:
    """Return the indices of points whose chords pass all points between within what is allowed."""

    def holds(start: int, end: int) -> bool:
        between = slice(start + 1, end)
        slope = (y[end] - y[start]) / (x[end] - x[start])
        chord = y[start] + slope * (x[between] - x[start])
        return bool(np.all(np.abs(chord - y[between]) <= allowed[between]))

    chosen, last = [0], len(x) - 1
    while (start := chosen[-1]) < last:
        good, step = start + 1, 2
        while start + step <= last and holds(start, start + step):
            good, step = start + step, 2 * step
        bad = min(start + step, last + 1)
        while bad - good > 1:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if holds(start, middle) else (good, middle)
        chosen.append(good)
    return np.array(chosen)


def _strictly_rising(pressure: Array) -> Array:
    """Return pressures that rise from row to row; the same ones where they do."""
    least = 1e-9 * pressure[-1]
    if np.all(np.diff(pressure) >= least):
        return pressure
    ramp = least * np.arange(len(pressure))
    return np.asarray(np.maximum.accumulate(pressure - ramp) + ramp)


def _error(law: PatchLaw, candidates: Array, closure: Array, pressure: Array) -> float:
    """Return the largest error of straight lines through rows, between the candidates too."""
    steps = np.linspace(0.0, 1.0, 4, endpoint=False)
    checks = (candidates[:-1, None] + np.diff(candidates)[:, None] * steps).ravel()
    exact = law.pressure(checks)
    scale = np.maximum(exact, LEAST_PRESSURE * pressure[-1])
    return float(np.max(np.abs(np.interp(checks, closure, pressure) - exact) / scale))


ROWS: tuple[float, ...] = ()
PIECES: tuple[tuple[float, ...], ...] = ()

_TITLES = {
    "ROWS": "# Closures of the rows, ascending [mm].",
    "PIECES": "# From each row on: width, then a cubic of the closure and one of p^(2/3), highest\n"
    "# power first, in the distance from the row; the last piece continues the tangent.",
}


def pressure(closure: float) -> float:
    """Return the pressure [MPa] at a closure [mm]."""
    return float(law(closure)[0])


def stiffness(closure: float) -> float:
    """Return the derivative of the pressure over the closure [MPa/mm]."""
    return float(law(closure)[1])


def evaluate(gap: float, offset: float) -> float:
    """Return what 4C takes as the pressure: negative in compression [MPa]."""
    return -pressure(-(gap + offset))


def evaluate_derivative(gap: float, offset: float) -> float:
    """Return the derivative of `evaluate` over the gap [MPa/mm]."""
    return stiffness(-(gap + offset))


def law(closure: float) -> tuple[float, float]:
    """Return the pressure and its derivative over the closure."""
    piece = bisect_right(ROWS, closure)
    if piece == 0:
        return 0.0, 0.0
    width, a, b, c, d, *power = PIECES[piece - 1]
    t = distance(width, a, b, c, d - closure) if width else (closure - d) / max(c, 1e-6)
    rise = max((3.0 * a * t + 2.0 * b) * t + c, 1e-6)
    root = max(((power[0] * t + power[1]) * t + power[2]) * t + power[3], 0.0) ** 0.5
    slope = (3.0 * power[0] * t + 2.0 * power[1]) * t + power[2]
    return root**3, 1.5 * root * slope / rise


def distance(width: float, a: float, b: float, c: float, d: float) -> float:
    """Return the root of a rising cubic between 0 and a width, by Newton's method in a bracket."""
    low, high = 0.0, width
    t = -d / (((a * width + b) * width + c) * width) * width
    for _ in range(80):
        value = ((a * t + b) * t + c) * t + d
        low, high = (t, high) if value < 0.0 else (low, t)
        newton = t - value / max((3.0 * a * t + 2.0 * b) * t + c, 1e-6)
        before, t = t, newton if low <= newton <= high else 0.5 * (low + high)
        if abs(t - before) <= 1e-14 * abs(t):
            break
    return t


_COPIED: tuple[Callable[..., object], ...] = (
    pressure, stiffness, evaluate, evaluate_derivative, law, distance,
)  # fmt: skip


_RANGE = """\
First touch at a closure of {:.9g} mm. The law is known up to {:.9g} mm; beyond, its tangent
continues."""
_OPEN = "The law stays open, its pressure is zero. First touch at a closure of {:.9g} mm."


def _head(table: LawTable, place: Place, path: str) -> str:
    """Return what the docstring of a module says."""
    extent = f"Patch: {place.extent}.\n" if place.extent else ""
    return f"""\
Contact law of {place.subject} of a rough surface, written by patchlaw, for 4C.

    CONTACT CONSTITUTIVE LAWS:
      - LAW: 1
        CoConstLaw_python_surrogate:
          Python_Filename: {path}
          Offset: 0.0

Units: mm, N, MPa. The closure is -(gap + offset). Closure 0: a rigid plane at the height of
{zero_text(table)}. Flat faces of the mesh that just touch stand for this state; the
mean plane of the roughness lies {place.law.initial_separation:.9g} mm below.
{extent}{(_OPEN if place.law.is_open else _RANGE).format(*place.law.range)}
The values are those of patchlaw's own interpolant, to rounding.
{made_by(table)}
"""


def law_modules(table: LawTable, name: str = "") -> dict[str, str]:
    """Return the names and texts of modules that evaluate the laws, one each.

    One process imports a module of one name once, from whatever folder.

    Args:
        table: The laws.
        name: Part of the modules' names; eight digits of a checksum of the laws by default.

    Raises:
        InputError: When the pressure of a law is a function of closure nowhere.
    """
    texts = {}
    every = repr([law_module_text(law, "") for law in table.laws if not law.is_flat])
    name = name or sha256(every.encode()).hexdigest()[:8]
    for place in places(table):
        if place.law.is_flat:
            raise no_function(place.subject)
        path = f"law_{name}_{place.label}.py"
        texts[path] = law_module_text(place.law, _head(table, place, path))
    return texts


def law_module_text(law: PatchLaw, head: str) -> str:
    """Return the text of a module that evaluates a law, to rounding as `PatchLaw` does.

    Args:
        law: The law; beyond its end, or where closure stops rising, the tangent continues.
        head: What the module's docstring says.
    """
    count = law.rising_rows
    rows = law.rows.closure[:count].tolist()
    widths = [*(law.rows.approach[1:count] - law.rows.approach[: count - 1]).tolist(), 0.0][:count]
    cubics = law.curves.rising.coefficients[1 : count + 1, :, :2]
    pieces = [
        (width, *cubic[:, 0].tolist(), *cubic[:, 1].tolist())
        for width, cubic in zip(widths, cubics, strict=True)
    ]
    lines = [f'"""{head}"""', "", "from bisect import bisect_right", ""]
    lines += [_TITLES["ROWS"], "ROWS = (", *(f"    {row!r}," for row in rows), ")"]
    lines += [_TITLES["PIECES"], "PIECES = (", *(f"    {piece!r}," for piece in pieces), ")"]
    sources = (inspect.getsource(function) for function in _COPIED)
    return "\n".join(lines) + "\n" + "".join(f"\n\n{source}" for source in sources)
