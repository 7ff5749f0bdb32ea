"""Puts the scales together.

A `Scene` becomes a problem setup (surface, summits, patches, micro model), the micro model gives
every patch its law, the laws go onto the flat interface of an elastic block, and load steps become
a `History`. A reference meshes the rough surface itself instead, and tells its own error.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

# ruff: noqa: F401
if TYPE_CHECKING:  # for editors and type checkers; at run time `_HOMES` says where names are
    from multiscale.comparison.compare import compare
    from multiscale.comparison.comparison import Comparison, Row
    from multiscale.couplings.condensed import CondensedCoupling
    from multiscale.couplings.load_steps import ContactCoupling, EmbeddedCoupling
    from multiscale.couplings.reference import ReferenceCoupling
    from multiscale.laws.consistent import consistent_laws
    from multiscale.laws.files import LawTable, read_laws, write_laws
    from multiscale.laws.isolated import isolated_laws
    from multiscale.laws.packed import PatchLaws
    from multiscale.laws.patch_law import PatchLaw
    from multiscale.loading.load_step import LoadStep, PatchState
    from multiscale.loading.stepper import LoadHistory, load_steps
    from multiscale.resolution.problem_setup import make_setup
    from multiscale.restart.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
    from multiscale.results.extrapolation import Estimate, extrapolated
    from multiscale.results.history import History
    from multiscale.results.reference_record import ReferenceRecord
    from multiscale.run import Run, run
    from multiscale.scene.scene import Scene
    from multiscale.setup.problem import ProblemSetup

_MODULES = {
    "comparison.compare": "compare",
    "comparison.comparison": "Comparison Row",
    "couplings.condensed": "CondensedCoupling",
    "couplings.load_steps": "ContactCoupling EmbeddedCoupling",
    "couplings.reference": "ReferenceCoupling",
    "laws.consistent": "consistent_laws",
    "laws.files": "LawTable read_laws write_laws",
    "laws.isolated": "isolated_laws",
    "laws.packed": "PatchLaws",
    "laws.patch_law": "PatchLaw",
    "loading.load_step": "LoadStep PatchState",
    "loading.stepper": "LoadHistory load_steps",
    "resolution.problem_setup": "make_setup",
    "restart.checkpoint": "Checkpoint read_checkpoint write_checkpoint",
    "results.extrapolation": "Estimate extrapolated",
    "results.history": "History",
    "results.reference_record": "ReferenceRecord",
    "run": "Run run",
    "scene.scene": "Scene",
    "setup.problem": "ProblemSetup",
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
