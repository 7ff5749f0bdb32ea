"""Public names of the package and their modules; `support.packages.public_names` reads them too."""

from .asperities.model import MODEL_NAMES as MODEL_NAMES
from .asperities.model import MODELS as MODELS
from .asperities.model import AsperityModel as AsperityModel
from .asperities.model import micro_model as micro_model
from .boundary_elements.body_modes import BodyModes as BodyModes
from .boundary_elements.body_modes import BodyStresses as BodyStresses
from .boundary_elements.body_modes import TractionModes as TractionModes
from .boundary_elements.body_modes import half_space_modes as half_space_modes
from .boundary_elements.body_modes import (
    half_space_stress_modes as half_space_stress_modes,
)
from .boundary_elements.body_modes import (
    half_space_traction_modes as half_space_traction_modes,
)
from .boundary_elements.body_modes import side_modes as side_modes
from .boundary_elements.body_modes import side_stress_modes as side_stress_modes
from .boundary_elements.finite_slopes import FiniteSlopes as FiniteSlopes
from .boundary_elements.finite_slopes import SurfaceStress as SurfaceStress
from .boundary_elements.finite_slopes import coarse_grid as coarse_grid
from .boundary_elements.free_sides import FreeSides as FreeSides
from .boundary_elements.rectangle_fields import RectangleFields as RectangleFields
from .boundary_elements.side_cells import SideStresses as SideStresses
from .boundary_elements.side_cells import side_stresses as side_stresses
from .closed_forms import HertzContact as HertzContact
from .closed_forms import influence_matrix as influence_matrix
from .friction.friction_model import FrictionModel as FrictionModel
from .half_space.model import HalfSpaceModel as HalfSpaceModel
from .half_space.model import RigidPlane as RigidPlane
from .half_space.read_off import Spots as Spots
from .half_space.read_off import find_spots as find_spots
from .model import ContactState as ContactState
from .model import MicroModel as MicroModel
from .model import NormalStiffness as NormalStiffness
from .model import Start as Start
from .model import Stiffness as Stiffness
from .model import press_along as press_along
