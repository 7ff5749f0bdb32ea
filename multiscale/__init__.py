"""Puts the scales together.

A `Scene` becomes a problem setup: surface, summits, patches and micro model. The micro model gives
every patch its law, and the laws act on the flat interface of an elastic block. The load steps
become a `History`. A reference meshes the rough surface itself instead, and measures its own error.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

# ruff: noqa: F401
if TYPE_CHECKING:  # for editors and type checkers; at run time `_HOMES` says where names are
    from multiscale.comparison.compare import compare
    from multiscale.comparison.comparison import Comparison
    from multiscale.couplings.condensed import CondensedCoupling
    from multiscale.couplings.reference import ReferenceCoupling
    from multiscale.laws.consistent import consistent_laws
    from multiscale.laws.files import read_laws, write_laws
    from multiscale.laws.isolated import isolated_laws
    from multiscale.laws.law_table import LawTable, PatchLaws
    from multiscale.laws.patch_law import PatchLaw
    from multiscale.loading.load_step import LoadStep
    from multiscale.loading.stepper import LoadHistory, load_steps
    from multiscale.planning.problem_setup import make_setup
    from multiscale.results.extrapolation import extrapolated
    from multiscale.results.history import History
    from multiscale.run import Run, run
    from multiscale.scene.scene import Scene

_MODULES = {
    "comparison.compare": "compare",
    "comparison.comparison": "Comparison",
    "couplings.condensed": "CondensedCoupling",
    "couplings.reference": "ReferenceCoupling",
    "laws.consistent": "consistent_laws",
    "laws.files": "read_laws write_laws",
    "laws.isolated": "isolated_laws",
    "laws.law_table": "LawTable PatchLaws",
    "laws.patch_law": "PatchLaw",
    "loading.load_step": "LoadStep",
    "loading.stepper": "LoadHistory load_steps",
    "planning.problem_setup": "make_setup",
    "results.extrapolation": "extrapolated",
    "results.history": "History",
    "run": "Run run",
    "scene.scene": "Scene",
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names.split()}
"""Module of every public name, which is imported with the first use of the name, for speed."""

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'multiscale' has no attribute '{name}'")
    return getattr(import_module(f"multiscale.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__


class _Package(ModuleType):
    """The package, whose attribute `run` is the function, not the module of the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "run" and isinstance(value, ModuleType):  # set by the import of that module
            value = value.run
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
