"""Public names of the package and their modules, for type checkers and for `micro` itself."""

from geometry.contact_state import ContactState as ContactState
from geometry.contact_state import Spots as Spots
from geometry.contact_state import Start as Start
from geometry.contact_state import stacked as stacked
from geometry.rigid_plane import RigidPlane as RigidPlane
from micro.asperities.contacts import SOLVERS as SOLVERS
from micro.asperities.model import MODELS as MODELS
from micro.asperities.model import AsperityModel as AsperityModel
from micro.boundary_elements.body_modes import BodyModes as BodyModes
from micro.boundary_elements.body_modes import BodyStresses as BodyStresses
from micro.boundary_elements.body_modes import TractionModes as TractionModes
from micro.boundary_elements.body_modes import (
    half_space_traction_modes as half_space_traction_modes,
)
from micro.boundary_elements.finite_slopes import FiniteSlopes as FiniteSlopes
from micro.boundary_elements.finite_slopes import SurfaceStress as SurfaceStress
from micro.boundary_elements.finite_slopes import coarse_grid as coarse_grid
from micro.boundary_elements.free_sides import FreeSides as FreeSides
from micro.boundary_elements.rectangle_fields import RectangleFields as RectangleFields
from micro.boundary_elements.rectangle_modes import half_space_modes as half_space_modes
from micro.boundary_elements.rectangle_modes import (
    half_space_stress_modes as half_space_stress_modes,
)
from micro.boundary_elements.rectangle_modes import side_modes as side_modes
from micro.boundary_elements.rectangle_modes import side_stress_modes as side_stress_modes
from micro.boundary_elements.side_cells import SideStresses as SideStresses
from micro.boundary_elements.side_cells import side_stresses as side_stresses
from micro.by_name import MODEL_NAMES as MODEL_NAMES
from micro.by_name import micro_model as micro_model
from micro.closed_forms.hertz import HertzContact as HertzContact
from micro.closed_forms.love import influence_matrix as influence_matrix
from micro.friction.friction_model import FrictionModel as FrictionModel
from micro.half_space.contact_spots import find_spots as find_spots
from micro.half_space.model import HalfSpaceModel as HalfSpaceModel
from micro.model import MicroModel as MicroModel
from micro.model import Stiffness as Stiffness
from micro.model import press_along as press_along
