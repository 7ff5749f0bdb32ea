"""Contact of a rough surface with a rigid plane on the scale of its asperities.

Every micro model presses a plane on a surface and returns a `Response` of the surface and its
patches. `HalfSpaceModel` solves the contact problem on the surface's cells. `AsperityModel` sees
its summits alone. `micro_model` makes any of them by name.

    closed_forms                                      Hertz, Love
    compliance → contact → half_space                 the contact problem on cells
    asperities                                        summits that interact pair by pair
"""

from geometry.rigid_plane import RigidPlane
from micro.asperities.contacts import SOLVERS
from micro.asperities.model import MODELS, AsperityModel
from micro.by_name import MODEL_NAMES, START_KINDS, micro_model
from micro.closed_forms.hertz import HertzContact
from micro.closed_forms.love import influence_matrix
from micro.compliance.body_modes import BodyModes, BodyStresses
from micro.compliance.finite_slopes import FiniteSlopes, SurfaceStress, coarse_grid
from micro.compliance.free_sides import FreeSides
from micro.compliance.rectangle_fields import RectangleFields
from micro.compliance.rectangle_modes import (
    half_space_modes,
    half_space_stress_modes,
    side_modes,
    side_stress_modes,
)
from micro.compliance.side_cells import SideStresses, side_stresses
from micro.compliance.slopes_of_bodies import SlopesOfBodies
from micro.half_space.contact_spots import Contacts, find_contacts
from micro.half_space.model import HalfSpaceModel
from micro.half_space.plane_contact import HalfSpaceState
from micro.model import MicroModel, Pressed, Response

__all__ = [
    "MODELS",
    "MODEL_NAMES",
    "SOLVERS",
    "START_KINDS",
    "AsperityModel",
    "BodyModes",
    "BodyStresses",
    "Contacts",
    "FiniteSlopes",
    "FreeSides",
    "HalfSpaceModel",
    "HalfSpaceState",
    "HertzContact",
    "MicroModel",
    "Pressed",
    "RectangleFields",
    "Response",
    "RigidPlane",
    "SideStresses",
    "SlopesOfBodies",
    "SurfaceStress",
    "coarse_grid",
    "find_contacts",
    "half_space_modes",
    "half_space_stress_modes",
    "influence_matrix",
    "micro_model",
    "side_modes",
    "side_stress_modes",
    "side_stresses",
]
