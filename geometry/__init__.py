"""Geometry of rough contact.

A spectrum or a file yields a surface. From the surface follow its statistics, its asperities and
its means over patches. A rigid plane presses on it, as a load step prescribes. Materials give the
contact modulus, and block shapes the mesh of the body under the surface.
"""

from patchlaw.support.packages import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
