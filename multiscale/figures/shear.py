"""The shear of a contact: cells that stick and slip, tractions, the loop of force and shift."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from multiscale.figures.maps import colour_bar, draw_image
from multiscale.figures.style import BLUE, PRESSURES, VERMILLION, map_panels, styled
from multiscale.readable import percent, usual_unit

_STICK, _SLIP = 1.0, 2.0
"""Values of cells that stick and slip in their map; open ones are masked."""


@styled()
def shear_figure(history: Any, record: Any) -> Figure:
    """Draw which cells stick and slip, the tractions on them, and shear force over shift.

    Args:
        history: A `multiscale.results.history.History`.
        record: A `multiscale.results.contact_record.ContactRecord` with tractions.
    """
    title = f"load step {record.step}: shear of the contact"
    figure, (cells, tractions, loop, lost) = map_panels(record.lengths_mm, 2, 2, title=title)
    _draw_cells(cells, record)
    _draw_tractions(tractions, record)
    _draw_loop(loop, history)
    unit, size = usual_unit(np.nan_to_num(history.dissipated_mJ).tolist(), "mJ")
    lost.plot(history.step, history.dissipated_mJ / size, color=BLUE)
    lost.set(xlabel="load step", ylabel=f"lost to friction [{unit}]", title="energy lost so far")
    return figure


def _draw_cells(axes: Any, record: Any) -> None:
    closed, slipping = record.pressure_MPa > 0.0, record.slipping
    values = np.where(closed, np.where(slipping, _SLIP, _STICK), 0.0)
    look: dict[str, Any] = {
        "cmap": ListedColormap([BLUE, VERMILLION]),
        "norm": Normalize(_STICK, _SLIP),
    }
    shown = np.ma.masked_equal(values, 0.0)
    draw_image(axes, record.lengths_mm, shown, largest=True, **look)
    slip = np.count_nonzero(slipping) / max(1, np.count_nonzero(closed))
    axes.set_title(f"blue sticks; {percent(slip, 3)} of the contact slips, in orange")


def _draw_tractions(axes: Any, record: Any) -> None:
    traction = np.hypot(*record.traction_MPa)
    unit, size = usual_unit([float(traction.max(initial=0.0))], "MPa")
    shown = np.ma.masked_where(record.pressure_MPa <= 0.0, traction / size)
    # few cells carry the largest tractions
    top = float(np.quantile(shown.compressed(), 0.99)) if shown.count() else 1.0
    look: dict[str, Any] = {"cmap": PRESSURES, "norm": Normalize(0.0, top or 1.0)}
    image = draw_image(axes, record.lengths_mm, shown, largest=True, **look)
    colour_bar(image, axes, f"tangential traction [{unit}]", extend="max")
    axes.set_title("tangential traction")


def _draw_loop(axes: Any, history: Any) -> None:
    """Draw the force over the shift, both along the direction of the largest shift."""
    steps = [step for step in history.steps if step.shear_x_mm is not None]
    shift = np.array([(0.0, 0.0), *((step.shear_x_mm, step.shear_y_mm) for step in steps)])
    force = np.array(
        [(0.0, 0.0), *((step.shear_force_x_N, step.shear_force_y_N) for step in steps)]
    )
    farthest = shift[np.argmax(np.hypot(*shift.T))]
    size = float(np.hypot(*farthest))
    along = farthest / size if size else np.array([1.0, 0.0])
    x, y = shift @ along, force @ along
    names = [usual_unit(values.tolist(), unit) for values, unit in ((x, "mm"), (y, "N"))]
    axes.plot(x / names[0][1], y / names[1][1], color=BLUE, marker="o", ms=2.5)
    axes.set(xlabel=f"shift [{names[0][0]}]", ylabel=f"shear force [{names[1][0]}]")
    axes.set_title("shear force along the largest shift")
