"""Puts the scales together.

A `Scene` becomes its coupling: surface, bodies, micro model, and how they are put together. The
coupling finds load steps: from contact problems, from patch laws on the flat interface of an
elastic body, or on meshes of the rough surface itself. The load steps become a `History`.

The public names and their modules stand in the stub ``__init__.pyi``, which editors and type
checkers read too. A module is imported with the first use of one of its names, for speed.
"""

from __future__ import annotations

import ast
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any


@cache
def _homes() -> dict[str, str]:
    """Return the module of every public name, as the stub says."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: str(node.module) for node in imports for alias in node.names}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return sorted(_homes())
    if name not in _homes():
        raise AttributeError(f"module 'multiscale' has no attribute '{name}'")
    from support.packages import optional_packages  # loads numpy

    with optional_packages():
        return getattr(import_module(_homes()[name]), name)


def __dir__() -> list[str]:
    return sorted(_homes())


class _Package(ModuleType):
    """The package, whose attribute `run` is the function, not the module of the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "run" and isinstance(value, ModuleType):  # set by the import of that module
            value = value.run
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
