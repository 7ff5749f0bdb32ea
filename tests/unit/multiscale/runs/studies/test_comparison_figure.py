"""What the figure of error over time tells: the frontier, and what it beats."""

import tomllib

import numpy as np
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Comparison, Scene
from patchlaw.multiscale.results.figures.studies import comparison_figure
from patchlaw.multiscale.runs.cases import CaseResult
from patchlaw.multiscale.runs.comparison import NO_ERRORS, Row

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
        scene="made up", rows=(*rows, measure), response="force", measure="measure",
        uncertainty=errors(bar),
    )  # fmt: skip


def panels(figure):
    return [axes for axes in figure.axes if axes.get_xscale() == "log"]


def test_the_frontier_is_numbered_and_what_it_beats_is_pale():
    rows = [row(0, 0.1, 0.1), row(1, 1.0, 0.2), row(2, 2.0, 0.01), row(3, 3.0, np.nan)]
    figure = comparison_figure(comparison(rows))
    assert len(panels(figure)) == 3
    for axes in panels(figure):
        assert sorted(text.get_text() for text in axes.texts) == ["1", "3", "5"]
        faint = [line.get_xdata()[0] for line in axes.lines if (line.get_alpha() or 1.0) < 1.0]
        assert faint == [1.0, 3.0]
