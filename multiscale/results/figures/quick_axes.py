"""Axes whose ticks are drawn together, in a third of the time: each is five artists otherwise."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axis import XAxis, YAxis
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import Bbox


def draw_quickly(axes: Any) -> None:
    """Let the first tick of each kind draw all others, which look like it, from now on.

    Args:
        axes: Axes in two dimensions, just made.
    """
    axes.xaxis.__class__, axes.yaxis.__class__ = _QuickXAxis, _QuickYAxis


class _QuickAxis:
    """Draws grid, ticks, their labels and that of the axis; layout and places are matplotlib's."""

    across: int
    """The coordinate of a page that the axis does not run along."""

    def draw(self: Any, renderer: Any, *given: Any, **options: Any) -> None:
        """Draw the axis."""
        places, formatter = self.get_majorticklocs(), self.get_major_formatter()
        texts = formatter.format_ticks(places)
        more = not isinstance(self.get_minor_formatter(), NullFormatter)  # labels of small ticks
        if not (self.get_visible() and texts) or more or formatter.get_offset():
            super().draw(renderer, *given, **options)  # type: ignore[misc]
            return
        low, high = np.sort(self.get_transform().transform(self.get_view_interval()))
        beyond = 1e-10 * (high - low)

        def seen(at: Any) -> Any:
            along = self.get_transform().transform(at)
            return (along >= low - beyond) & (along <= high + beyond)

        renderer.open_group(__name__, gid=self.get_gid())
        boxes = [self.axes.bbox.frozen()]
        major, shown = self.majorTicks[0], seen(places)
        self._draw_lines(major, places[shown], renderer)
        for place, text in zip(places[shown], np.asarray(texts, object)[shown], strict=True):
            major.update_position(place)
            for label in (major.label1, major.label2):
                label.set_text(text)
                if label.get_visible() and text:
                    label.draw(renderer)
                    boxes.append(label.get_window_extent(renderer))
        if len(minor := self.get_minorticklocs()):
            self._draw_lines(self.minorTicks[0], minor[seen(minor)], renderer)
        self._place_label(Bbox.union(boxes))
        self.label.draw(renderer)
        renderer.close_group(__name__)
        self.stale = False

    def _draw_lines(self: Any, tick: Any, places: Any, renderer: Any) -> None:
        """Draw a tick and its line of the grid at several places."""
        ends, gap = np.repeat(places, 3), np.tile([0.0, 1.0, np.nan], len(places))
        for line, along, beside in (
            (tick.gridline, ends, gap),
            (tick.tick1line, places, np.zeros(len(places))),
            (tick.tick2line, places, np.ones(len(places))),
        ):
            if line.get_visible():
                kept = line.get_data(orig=True)
                line.set_data(*((beside, along) if self.across == 0 else (along, beside)))
                line.draw(renderer)
                line.set_data(*kept)

    def _place_label(self: Any, taken: Any) -> None:
        """Place the label of the axis beside the labels of its ticks."""
        first = self.label_position in ("left", "bottom")
        distance = self.labelpad * self.figure.dpi / 72.0
        places = list(self.label.get_position())
        places[self.across] = (
            taken.min[self.across] - distance if first else taken.max[self.across] + distance
        )
        self.label.set_position(places)


class _QuickXAxis(_QuickAxis, XAxis):
    across = 1


class _QuickYAxis(_QuickAxis, YAxis):
    across = 0
