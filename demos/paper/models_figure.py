"""The four panels in which the paper compares micro models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from patchlaw.geometry import stacked
from patchlaw.micro import ContactState
from patchlaw.multiscale.results.figures.style import (
    FULL_WIDTH,
    MODELS,
    add_legend,
    new_figure,
    styled,
)


@styled()
def models_figure(
    curves: Mapping[str, Sequence[ContactState]], *, rms_slope: float, contact_modulus: float
) -> Figure:
    """Draw the four panels of Waddad et al. 2016, Fig. 7, for several micro models.

    Args:
        curves: States of each micro model at rising approaches, by its name.
        rms_slope: rms gradient of the surface, which scales κ.
        contact_modulus: E* [MPa], likewise.
    """
    figure = new_figure(FULL_WIDTH, 5.4)
    (motion, separation), (area, kappa) = figure.subplots(2, 2)
    for name, states in curves.items():
        look = {
            "ls": MODELS[name]["ls"],
            "color": MODELS[name]["color"],
            "label": name.replace("-independent", ", no interaction"),
        }
        pressure = stacked(states, "mean_pressure")
        fraction = 100 * stacked(states, "contact_area_fraction")
        motion.plot(1e3 * stacked(states, "approach"), pressure, **look)
        separation.plot(1e3 * stacked(states, "mean_separation"), pressure, **look)
        area.plot(pressure, fraction, **look)
        values = [state.kappa(rms_slope, contact_modulus) for state in states]
        kappa.plot(fraction, values, **look)
    motion.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]", title="(i)")
    separation.set(xlabel="mean separation [µm]", ylabel="mean pressure [MPa]", title="(ii)")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]", title="(iii)")
    kappa.set(xlabel="contact area fraction [%]", ylabel="κ", title="(iv)")
    add_legend(figure)
    return figure
