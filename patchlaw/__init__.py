"""Contact of rough surfaces: what most users need, under one name.

The packages below it have all else: `patchlaw.geometry`, `patchlaw.micro`, `patchlaw.macro` and
`patchlaw.multiscale`. The names stand in ``__init__.pyi``; a module is imported with the first use
of one of its names.
"""

from pathlib import Path

if not Path(__file__).with_name("support").is_dir():  # Python was started in the project's folder
    __path__.append(str(Path(__file__).parents[1]))

from patchlaw.support.packages import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
