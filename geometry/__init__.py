"""Geometry of rough contact.

A spectrum or a file yields a surface. From the surface follow its statistics, its asperities and
its means over patches. A rigid plane presses on it, as a load step prescribes. Materials give the
contact modulus, and block shapes the mesh of the body under the surface.
"""

import sys

from support.packages import LazyPackage

sys.modules[__name__].__class__ = LazyPackage
