"""A patch law as a Python module that needs nothing else: the interpolant itself, for 4C.

4C's `CoConstLaw_python_surrogate` imports a module and calls ``evaluate(gap, offset)`` and
``evaluate_derivative(gap, offset)`` at the nodes where ``gap + offset`` ≤ 0. Both returns follow
its other laws: a pressure in compression is negative, and the derivative is that over the gap.

The functions below are copied into the module as they stand, with `ROWS` and `PIECES` of the law.
"""

from __future__ import annotations

import inspect
from bisect import bisect_right
from collections.abc import Callable
from hashlib import sha256

from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.sampling import Place, made_by, no_function, places, zero_text

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
