"""Puts the scales together.

A `Scene` becomes a problem setup (surface, summits, patches, micro model), the micro model gives
every patch its law, the laws go onto the flat interface of an elastic block, and load steps become
a `History`. A reference meshes the rough surface itself instead, and tells its own error.
"""

from multiscale.comparison.compare import compare
from multiscale.comparison.comparison import Comparison, Row
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.couplings.load_steps import ContactCoupling, EmbeddedCoupling
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.laws.consistent import consistent_laws
from multiscale.laws.files import read_laws, write_laws
from multiscale.laws.isolated import isolated_laws
from multiscale.laws.law_table import LawTable, PatchLaws
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

__all__ = [
    "Checkpoint",
    "Comparison",
    "CondensedCoupling",
    "ContactCoupling",
    "EmbeddedCoupling",
    "Estimate",
    "History",
    "LawTable",
    "LoadHistory",
    "LoadStep",
    "PatchLaw",
    "PatchLaws",
    "PatchState",
    "ProblemSetup",
    "ReferenceCoupling",
    "ReferenceRecord",
    "Row",
    "Run",
    "Scene",
    "compare",
    "consistent_laws",
    "extrapolated",
    "isolated_laws",
    "load_steps",
    "make_setup",
    "read_checkpoint",
    "read_laws",
    "run",
    "write_checkpoint",
    "write_laws",
]
