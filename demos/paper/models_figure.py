"""The four panels in which the paper compares micro models."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

from matplotlib.figure import Figure

from micro.model import Response
from multiscale.figures.style import COLOURS, LINE_STYLES, add_grid_and_legend, new_figure


def models_figure(responses: Mapping[str, Response], *, rms_slope: float) -> Figure:
    """Draw the four panels of Waddad et al. 2016, Fig. 7, for several micro models.

    Args:
        responses: Response of each micro model by its name.
        rms_slope: rms gradient of the surface, which scales κ.
    """
    figure = new_figure(9.6, 7.2)
    (motion, separation), (area, kappa) = figure.subplots(2, 2)
    styles = zip(cycle(LINE_STYLES), cycle(COLOURS.values()))
    for (style, colour), (name, response) in zip(styles, responses.items(), strict=False):
        look = {"ls": style, "color": colour, "label": name}
        pressure, fraction = response.mean_pressure, 100 * response.contact_area_fraction
        motion.plot(1e3 * response.approach, pressure, **look)
        separation.plot(1e3 * response.mean_separation, pressure, **look)
        area.plot(pressure, fraction, **look)
        kappa.plot(fraction, response.kappa(rms_slope), **look)
    motion.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]", title="(i)")
    separation.set(xlabel="mean separation [µm]", ylabel="mean pressure [MPa]", title="(ii)")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]", title="(iii)")
    kappa.set(xlabel="contact area fraction [%]", ylabel="κ", title="(iv)")
    add_grid_and_legend(figure)
    return figure
