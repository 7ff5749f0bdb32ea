"""The four panels in which the paper compares micro models."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from micro.model import Response
from multiscale.figures.style import FULL_WIDTH, MODELS, add_legend, new_figure, styled


@styled()
def models_figure(responses: Mapping[str, Response], *, rms_slope: float) -> Figure:
    """Draw the four panels of Waddad et al. 2016, Fig. 7, for several micro models.

    Args:
        responses: Response of each micro model by its name.
        rms_slope: rms gradient of the surface, which scales κ.
    """
    figure = new_figure(FULL_WIDTH, 5.4)
    (motion, separation), (area, kappa) = figure.subplots(2, 2)
    for name, response in responses.items():
        look = {"ls": MODELS[name]["ls"], "color": MODELS[name]["color"], "label": name}
        pressure, fraction = response.mean_pressure, 100 * response.contact_area_fraction
        motion.plot(1e3 * response.approach, pressure, **look)
        separation.plot(1e3 * response.mean_separation, pressure, **look)
        area.plot(pressure, fraction, **look)
        kappa.plot(fraction, response.kappa(rms_slope), **look)
    motion.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]", title="(i)")
    separation.set(xlabel="mean separation [µm]", ylabel="mean pressure [MPa]", title="(ii)")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]", title="(iii)")
    kappa.set(xlabel="contact area fraction [%]", ylabel="κ", title="(iv)")
    add_legend(figure)
    return figure
