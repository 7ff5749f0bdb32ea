"""What the figure of error over time tells: the whole frontier, and nothing over another."""

import tomllib

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE
from matplotlib.text import Text

from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.studies.comparison import Comparison
from patchlaw.multiscale.studies.errors import NO_ERRORS, Row
from patchlaw.multiscale.studies.figures import comparison_figure
from patchlaw.multiscale.studies.running import CaseResult

KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")
BASE = Scene.from_dict(tomllib.loads(SMALL_SCENE))
SCENES = {kind: BASE.with_({"coupling.kind": kind}) for kind in KINDS}


def errors(size):
    return NO_ERRORS | {"force_max": size, "area_max": size, "distribution": size}


def row(number, seconds, size, *, steps=8, name="", status="done", is_measure=False):
    kind = KINDS[number % len(KINDS)]
    measured = {"seconds": seconds}
    result = CaseResult(status=status, measured=measured, arrays={"force": np.ones(steps)})
    return Row(
        name=name or f"{kind}, number {number}", scene=SCENES[kind], result=result,
        is_measure=is_measure, errors=errors(size),
    )  # fmt: skip


def comparison(rows, bar=1e-3):
    measure = row(4, 30.0, bar, name="measure", is_measure=True)
    return Comparison(
        scene="made up",
        rows=(*rows, measure),
        response="force",
        measure="measure",
        uncertainty=errors(bar),
    )


def crowded(seed, count=30):
    """Return rows of which many stand upon each other, some of them on the frontier."""
    rng = np.random.default_rng(seed)
    exponents = np.sort(rng.uniform(-1.0, 1.0, count // 3)).repeat(3)
    seconds = 10 ** (exponents + rng.uniform(0.0, 0.06, count))
    sizes = 10 ** (-1.0 - exponents + rng.uniform(0.0, 0.06, count))
    return [row(n, *at) for n, at in enumerate(zip(seconds, sizes, strict=True))]


def panels(figure):
    return [axes for axes in figure.axes if axes.get_xscale() == "log"]


@pytest.mark.parametrize("seed", range(2))
def test_every_row_of_the_frontier_is_numbered_where_it_can_be_read(seed):
    found = comparison(crowded(seed))
    ahead = {one.name for one in found.frontier()} | {"measure"}
    wanted = sorted(str(n) for n, one in enumerate(found.rows, 1) if one.name in ahead)
    assert len(wanted) >= 8
    figure = comparison_figure(found)
    figure.draw_without_rendering()
    for axes in panels(figure):
        assert sorted(text.get_text() for text in axes.texts) == wanted
        boxes = [Text.get_window_extent(text) for text in axes.texts]  # without their leaders
        for index, box in enumerate(boxes):
            assert axes.bbox.x0 <= box.x0 < box.x1 <= axes.bbox.x1
            assert not any(box.overlaps(other) for other in boxes[:index])


def labels(figure):
    return [text.get_text() for axes in figure.axes if axes.get_legend() for text in
            axes.get_legend().get_texts()]  # fmt: skip


def test_legend_tells_of_configurations_that_ended_early_where_there_are_any():
    rows = [row(0, 0.1, 0.1), row(1, 1.0, 0.01)]
    assert not any(
        label.startswith("hollow") for label in labels(comparison_figure(comparison(rows)))
    )
    rows[0] = row(0, 0.1, 0.1, status="not converged", steps=3)
    figure = comparison_figure(comparison(rows))
    assert "hollow: ended before the last load step" in labels(figure)
    hollow = [line for line in panels(figure)[0].lines if line.get_markerfacecolor() == "none"]
    assert [line.get_xdata()[0] for line in hollow] == [0.1]


def test_configurations_that_are_beaten_are_pale():
    rows = [row(0, 0.1, 0.1), row(1, 1.0, 0.2), row(2, 2.0, 0.01)]
    for axes in panels(comparison_figure(comparison(rows))):
        faint = [line.get_xdata()[0] for line in axes.lines if (line.get_alpha() or 1.0) < 1.0]
        assert faint == [1.0]
