"""Axes that draw all ticks of an axis at once; matplotlib makes five objects of each one.

Figures take half the time with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox, IdentityTransform

from patchlaw.support.arrays import Array

_OFFSET_PAD = 3.0
"""Distance of the power of ten that numbers are multiples of [points]."""


class _PlainAxis:
    """An axis with ticks outwards on the side of its label, all of which the style determines."""

    axes: Any
    axis_name: str
    _has_grid = False
    _drawn: Bbox | None = None

    def reset_ticks(self) -> None:
        """Have no objects of ticks."""
        self.majorTicks: list[Any] = []
        self.minorTicks: list[Any] = []

    def grid(self, visible: bool | None = None, **_: Any) -> None:
        """Choose whether there are lines at the major ticks."""
        self._has_grid = bool(visible)

    def get_ticks_position(self: Any) -> str:
        """Return the side of the ticks."""
        return str(self.get_label_position())

    def get_tightbbox(self, *_: Any, **__: Any) -> Bbox | None:
        """Return the box of numbers and labels when they were last drawn [pixels]."""
        return self._drawn

    def draw(self: Any, renderer: Any) -> None:
        """Draw grid, ticks, their numbers and the label of the axis."""
        self._drawn = None
        if not self.get_visible():
            return
        values = self.get_majorticklocs()
        if self._has_grid:
            edges = self._ends(across=True)
            self._draw_lines(renderer, self._places(values), edges, "grid.color", "grid.linewidth")
        boxes = self._draw_ticks(renderer, "minor", self.get_minorticklocs())
        boxes += self._draw_ticks(renderer, "major", values)
        end, out = self._side()
        ends = [self._point(*box.get_points()[int(out > 0.0)])[1] for box in boxes]
        end = out * max(out * each for each in (end, *ends))
        along, points = self.label.get_position()[self.axis_name == "y"], renderer.points_to_pixels
        self.label.set_position(self._point(along, end + out * points(self.labelpad)))
        self.offsetText.set_text(self.major.formatter.get_offset())
        end, out = (end, out) if self.axis_name == "x" else (self.axes.bbox.y1, 1.0)
        self.offsetText.set_y(end + out * points(_OFFSET_PAD))
        for text in (self.label, self.offsetText):
            text.draw(renderer)
            boxes.append(text.get_window_extent(renderer))
        self._drawn = Bbox.union([box for box in boxes if box.width > 0.0] or [self.axes.bbox])
        self.stale = False

    def _draw_ticks(self: Any, renderer: Any, kind: str, values: Array) -> list[Bbox]:
        """Draw the major or minor ticks with their numbers; return the boxes of these [pixels]."""
        name, points, (edge, out) = f"{self.axis_name}tick", renderer.points_to_pixels, self._side()
        places, tip = self._places(values), edge + out * points(rcParams[f"{name}.{kind}.size"])
        looks = f"{name}.color", f"{name}.{kind}.width"
        self._draw_lines(renderer, places, (edge, tip), *looks)
        numbers = zip(places, getattr(self, kind).formatter.format_ticks(values), strict=True)
        shown = [(place, number) for place, number in numbers if number and np.isfinite(place)]
        return self._draw_numbers(
            renderer, shown, tip + out * points(rcParams[f"{name}.{kind}.pad"])
        )

    def _side(self: Any) -> tuple[float, float]:
        """Return the edge that has the ticks, and the sign of what lies outwards of it [pixels]."""
        low, high = self._ends(across=True)
        return (high, 1.0) if self.get_label_position() in ("right", "top") else (low, -1.0)

    def _ends(self, *, across: bool) -> tuple[float, float]:
        """Return where the axes begin and end along the axis, or across it [pixels]."""
        box = self.axes.bbox
        return (box.x0, box.x1) if (self.axis_name == "x") != across else (box.y0, box.y1)

    def _point(self, along: float, across: float) -> tuple[float, float]:
        """Return x and y of a point."""
        return (along, across) if self.axis_name == "x" else (across, along)

    def _places(self: Any, values: Any) -> Array:
        """Return where values are along the axis [pixels]; NaN outside the view."""
        scaled = self.get_transform().transform(np.asarray(values, float))
        first, last = self.get_transform().transform(np.asarray(self.get_view_interval(), float))
        low, high = self._ends(across=False)
        places = low + (scaled - first) / (last - first) * (high - low)
        return np.where((places > low - 0.5) & (places < high + 0.5), places, np.nan)

    def _draw_lines(
        self, renderer: Any, places: Array, ends: tuple[float, float], colour: str, width: str
    ) -> None:
        """Draw lines across the axis; their look is that of these parameters of the style."""
        known = places[np.isfinite(places)]
        if not known.size:
            return
        corners = np.empty((len(known), 2, 2))
        along = int(self.axis_name == "y")
        corners[..., along], corners[..., 1 - along] = known[:, None], ends
        pen = renderer.new_gc()
        pen.set_foreground(rcParams[colour])
        pen.set_linewidth(rcParams[width])
        pen.set_snap(True)
        codes = np.tile([Path.MOVETO, Path.LINETO], len(known))
        renderer.draw_path(pen, Path(corners.reshape(-1, 2), codes), IdentityTransform())
        pen.restore()

    def _draw_numbers(
        self, renderer: Any, numbers: Sequence[tuple[float, str]], beside: float
    ) -> list[Bbox]:
        """Write numbers at places along the axis; return their boxes [pixels]."""
        boxes = list[Bbox]()
        if not numbers:
            return boxes
        name, far = f"{self.axis_name}tick", self._side()[1] > 0.0
        text = Text(color=rcParams[f"{name}.labelcolor"], size=rcParams[f"{name}.labelsize"])
        text.set_figure(self.axes.figure)
        if self.axis_name == "x":
            text.set(ha="center", va="bottom" if far else "top")
        else:
            text.set(ha="left" if far else "right", va="center_baseline")
        for place, number in numbers:
            text.set_text(number)
            text.set_position(self._point(place, beside))
            text.draw(renderer)
            boxes.append(text.get_window_extent(renderer))
        return boxes


class _PlainXAxis(_PlainAxis, XAxis):
    """The x axis."""


class _PlainYAxis(_PlainAxis, YAxis):
    """The y axis."""


class PlainAxes(Axes):
    """Axes whose ticks are drawn at once."""

    def _init_axis(self) -> None:
        self.xaxis, self.yaxis = _PlainXAxis(self), _PlainYAxis(self)
        for spine in self.spines.values():
            spine.set_position(("outward", 0.0))  # ticks, of which there are none, would set it
        self._update_transScale()
