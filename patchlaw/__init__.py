"""Contact of rough surfaces: what most users need, under one name.

The packages below it have all else: `patchlaw.geometry`, `patchlaw.micro`, `patchlaw.macro` and
`patchlaw.multiscale`. The names stand in ``__init__.pyi``; a module is imported with the first use
of one of its names.
"""

from patchlaw.support.packages import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
