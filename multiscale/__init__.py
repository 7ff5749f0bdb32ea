"""Puts the scales together.

A `Scene` becomes its coupling: surface, bodies, micro model, and how they are put together. The
coupling finds load steps: from contact problems, from patch laws on the flat interface of an
elastic body, or on meshes of the rough surface itself. The load steps become a `History`.

The public names and their modules stand in the stub ``__init__.pyi``, which editors and type
checkers read too. A module is imported with the first use of one of its names, for speed.
"""

from patchlaw.support.packages import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
