"""Puts the scales together.

A `Scene` becomes a problem setup: surface, summits, patches and micro model. The micro model gives
every patch its law, and the laws act on the flat interface of an elastic block. The load steps
become a `History`. A reference meshes the rough surface itself instead, and measures its own error.
"""

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
from multiscale.resolution.problem_setup import make_setup
from multiscale.results.extrapolation import extrapolated
from multiscale.results.history import History
from multiscale.run import Run, run
from multiscale.scene.scene import Scene

__all__ = [
    "Comparison",
    "CondensedCoupling",
    "History",
    "LawTable",
    "LoadHistory",
    "LoadStep",
    "PatchLaw",
    "PatchLaws",
    "ReferenceCoupling",
    "Run",
    "Scene",
    "compare",
    "consistent_laws",
    "extrapolated",
    "isolated_laws",
    "load_steps",
    "make_setup",
    "read_laws",
    "run",
    "write_laws",
]
