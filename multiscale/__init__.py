"""Puts the scales together.

A `Scene` becomes a stage (surface, summits, patches, micro model), the micro model gives every
patch its law, the laws go onto the flat interface of an elastic block, and load steps become a
`History`. A reference meshes the rough surface itself instead, and tells its own error.
"""

from multiscale.compare import compare
from multiscale.comparing.comparison import Comparison, Row
from multiscale.coupling import ContactCoupling, EmbeddedCoupling
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.history import History
from multiscale.law_tables.consistent import consistent_laws
from multiscale.law_tables.isolated import isolated_laws
from multiscale.law_tables.law_files import LawTable, read_laws, write_laws
from multiscale.law_tables.patch_laws import PatchLaws
from multiscale.laws import PatchLaw
from multiscale.load_step import LoadStep, PatchState
from multiscale.loading import Programme, load_steps
from multiscale.reference.coupling import ReferenceCoupling
from multiscale.reference.extrapolation import Estimate, extrapolated
from multiscale.reference.record import ReferenceRecord
from multiscale.restart.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from multiscale.run import Run, run
from multiscale.scene import Scene
from multiscale.stage import Stage
from multiscale.staging import make_stage

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
