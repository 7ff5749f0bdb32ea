"""Terms that the compliance of the half-space is summed with.

`FiniteSlopes` is what slopes that are not small add; terms of `SurfaceStress` tell it the stresses
in the surface that the half-space does not have, such as those near free sides.
"""

from micro.compliance.finite_slopes import FiniteSlopes
from micro.compliance.surface_stress import SurfaceStress

__all__ = ["FiniteSlopes", "SurfaceStress"]
