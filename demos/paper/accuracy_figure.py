"""Errors of the micro models: over the contact area, and over the time they take."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.multiscale.results.figures.style import (
    ERROR_BAND,
    FULL_WIDTH,
    MODELS,
    new_figure,
    use_style,
)

Array = NDArray[np.float64]


def look(model: str) -> dict[str, Any]:
    """Return marker and colours of a model, whose name begins with that of its kind."""
    style = MODELS[model.partition(",")[0]]
    return {key: style[key] for key in ("marker", "color", "mfc") if key in style}


def draw_accuracy(
    path: Path,
    fractions: Array,
    errors: Mapping[str, Array],
    places: Mapping[str, tuple[float, float]],
    bar: float,
    answer: str,
) -> None:
    """Draw the errors of single surfaces, and those of all over the time.

    Args:
        path: The PNG file.
        fractions: Contact area over nominal area of all surfaces and approaches.
        errors: Errors of the force of some models, as `fractions`.
        places: Time per approach [ms] and rms error of the force [%] of models; those of
            half-spaces are joined.
        bar: Error of what the models are measured by [%].
        answer: What is said of the picture, for its file.
    """
    use_style()
    figure = new_figure(FULL_WIDTH, 3.0)
    left, right = figure.subplots(1, 2)
    for key, values in errors.items():
        size = 3.5 if "independent" in key else 2.5
        left.semilogx(100 * fractions.ravel(), 100 * values.ravel(), ls="", ms=size, **look(key))
    left.set(
        xlabel="contact area [% of the face]", ylabel="error of the force [%]", ylim=(-40, 100)
    )
    joined = {key: place for key, place in places.items() if key.startswith("half-space")}
    right.loglog(*zip(*joined.values(), strict=True), **look("half-space"))
    for key, place in places.items():
        right.plot(*place, ms=5, **look(key))
    for axes, key, at, text in (
        (left, "elliptic", (0.105, 93), "hollow: asperities without interaction"),
        (left, "elliptic", (0.105, 84), "filled: with interaction"),
        (left, "half-space", (0.105, 75), "triangles: half-space, 64² heights"),
        (right, "elliptic", (2.9, 25), "without interaction"),
        (right, "elliptic", (2.9, 10.5), "with interaction"),
        *((right, key, (1.25 * x, 1.05 * y), key) for key, (x, y) in joined.items()),
    ):
        side = "right" if at[0] > 30 else "left"
        axes.text(
            *at,
            text,
            color=look(key)["color"],
            ha=side,
            va="center" if side == "left" else "bottom",
        )
    right.axhspan(0.01, bar, **ERROR_BAND)
    right.text(1.1, 0.75 * bar, "error of the reference itself", va="top", color="0.4")
    right.set(ylim=(0.02, 100), xlim=(1, 100))
    right.set(xlabel="time per approach [ms]", ylabel="rms error of the force [%]")
    for axis in (left.xaxis, right.xaxis, right.yaxis):
        axis.set_major_formatter("{x:g}")
    figure.savefig(path, metadata={"answer": answer})
