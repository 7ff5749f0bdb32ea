"""Puts the scales together.

A `Scene` becomes a stage (surface, summits, patches, micro model), the micro model gives every
patch its law, the laws go onto the flat interface of an elastic block, and load steps become a
`History`. A reference meshes the rough surface itself instead, and tells its own error.
"""

from multiscale.compare.comparison import Comparison, Row
from multiscale.compare.run_comparison import compare
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.couplings.load_steps import ContactCoupling, EmbeddedCoupling
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.laws.consistent import consistent_laws
from multiscale.laws.files import LawTable, read_laws, write_laws
from multiscale.laws.isolated import isolated_laws
from multiscale.laws.packed import PatchLaws
from multiscale.laws.patch_law import PatchLaw
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.loading.stepper import Programme, load_steps
from multiscale.resolution.problem_setup import make_stage
from multiscale.restart.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from multiscale.results.extrapolation import Estimate, extrapolated
from multiscale.results.history import History
from multiscale.results.reference_record import ReferenceRecord
from multiscale.run import Run, run
from multiscale.scene.scene import Scene
from multiscale.setup.problem import Stage

__all__ = [
    "Checkpoint",
    "Comparison",
    "CondensedCoupling",
    "ContactCoupling",
    "EmbeddedCoupling",
    "Estimate",
    "History",
    "LawTable",
    "LoadStep",
    "PatchLaw",
    "PatchLaws",
    "PatchState",
    "Programme",
    "ReferenceCoupling",
    "ReferenceRecord",
    "Row",
    "Run",
    "Scene",
    "Stage",
    "compare",
    "consistent_laws",
    "extrapolated",
    "isolated_laws",
    "load_steps",
    "make_stage",
    "read_checkpoint",
    "read_laws",
    "run",
    "write_checkpoint",
    "write_laws",
]
