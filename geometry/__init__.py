"""Geometry of rough contact.

A spectrum or a file yields a surface. From the surface follow its statistics, its asperities and
its means over patches. A rigid plane presses on it, as a load step prescribes. Materials give the
contact modulus, and block shapes the mesh of the body under the surface.
"""

from geometry.asperities import Asperities, find_asperities
from geometry.facing import facing, laid_on, mirrored, turned_over
from geometry.files.reading import read_surface
from geometry.materials import Material, MaterialPair
from geometry.meshes.block import BlockShape, misalignment
from geometry.meshes.families import (
    characteristic_size,
    places_in_reach,
    reference_shapes,
    suggested_fine,
)
from geometry.meshes.refined_block import RefinedShape
from geometry.patches import PatchGrid, Regions, overlaps, patch_means
from geometry.preparation import Crop, Filter, Preparation
from geometry.rigid_plane import Control, RigidPlane
from geometry.spectrum import Spectrum, synthesise
from geometry.statistics import PowerSpectrum, Roughness, power_spectrum, roughness
from geometry.surface import Surface
from support.errors import InputError, NotConverged, NotInstalled, PatchlawError

__all__ = [
    "Asperities",
    "BlockShape",
    "Control",
    "Crop",
    "Filter",
    "InputError",
    "Material",
    "MaterialPair",
    "NotConverged",
    "NotInstalled",
    "PatchGrid",
    "PatchlawError",
    "PowerSpectrum",
    "Preparation",
    "RefinedShape",
    "Regions",
    "RigidPlane",
    "Roughness",
    "Spectrum",
    "Surface",
    "characteristic_size",
    "facing",
    "find_asperities",
    "laid_on",
    "mirrored",
    "misalignment",
    "overlaps",
    "patch_means",
    "places_in_reach",
    "power_spectrum",
    "read_surface",
    "reference_shapes",
    "roughness",
    "suggested_fine",
    "synthesise",
    "turned_over",
]
