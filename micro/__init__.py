"""Contact of a rough surface with a rigid plane on the scale of its asperities.

Every micro model has one entry, ``press``: a plane under a `Control` presses on the surface, and a
`ContactState` tells the contact of the surface and its patches. `HalfSpaceModel` solves the contact
problem on the surface's cells. `AsperityModel` sees its summits alone. `micro_model` makes any of
them by name.

    closed_forms                                      Hertz, Love
    boundary_elements → complementarity → half_space  the contact problem on cells
    friction                                          tractions, stick and slip on the cells
    asperities                                        summits that interact pair by pair
    gap_cells → gap_pools → gap_multigrid → gap_iteration → transport   leaks, conductance of spots
"""

from patchlaw.support.packages import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
