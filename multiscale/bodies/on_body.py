"""Puts half-space models on the bodies of a scene, finite slopes included.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from geometry import MaterialPair, Surface
from micro import FiniteSlopes, HalfSpaceModel
from multiscale.bodies.bodies import Bodies

OnBody = Callable[[HalfSpaceModel, int], HalfSpaceModel]
"""Puts a half-space model on a body; with finite slopes up to an order, 0 for none."""

SLOPES = 2
"""Order of finite slopes where they are taken into account."""

_RESIDUAL = 1e-10
"""Residual of half-space solutions. Their forces are then right to 1e-12, so that neither the unit
of length nor the number of ranks changes a result. It costs a tenth more than 1e-8."""


def on_body(
    bodies: Bodies | None,
    materials: MaterialPair,
    counter: Surface | None,
    *,
    more_modes: int = 0,
) -> OnBody:
    """Return what puts half-space models on the bodies of a scene, which are solved for once.

    Args:
        bodies: The bodies; None for half-spaces.
        materials: The materials on both sides.
        counter: What of the surface is the counter-body's; None where that is smooth.
        more_modes: Modes of the body along a side beyond those that its shape needs.

    Returns:
        A function from a model and the order of finite slopes, 0 for none, to the model on the
        body. It is not collective.

    Note:
        Collective.
    """
    terms = None if bodies is None else bodies.terms(side_term=True)
    face = None
    if bodies is not None and terms is not None:
        modes = terms.modes + more_modes if more_modes else None
        face = terms.face(bodies.comm, modes=modes)

    def put(model: HalfSpaceModel, order: int) -> HalfSpaceModel:
        model, above = replace(model, tolerance=_RESIDUAL), None
        surface = model.surface
        if counter is not None:  # each body has slopes of its own
            above = counter.on_grid(surface.grid)
            surface = replace(surface, heights=surface.heights - above.heights)
        # With finite slopes heights count from the highest point, near the loads, where slopes add
        # least. The flat body then ends at it, while the block's height is that of the mean plane.
        higher = surface.highest - surface.mean_height if order else 0.0
        if terms is not None and face is not None:
            model = replace(model, body=terms.term(face, higher=higher))
            if terms.side_term is not None:
                share = terms.side_share(model.contact_modulus)
                model = replace(model, sides=replace(terms.side_term, share=share))
        if not order:
            return model
        stresses = [] if terms is None or face is None else terms.stresses(face, surface)
        plane = surface.highest if stresses else None
        slopes = FiniteSlopes(
            surface,
            materials.first,
            periodic=model.periodic,
            plane=plane,
            edge_stresses=stresses,
        )
        if above is None or materials.second is None:
            return replace(model, slopes=(slopes,))
        others = FiniteSlopes(above, materials.second, periodic=model.periodic)
        return replace(model, slopes=(slopes, others))

    return put
