"""Puts the scales together.

A `Scene` becomes a stage (surface, summits, patches, micro model), the micro model gives every
patch its law, the laws go onto the flat interface of an elastic block, and load steps become a
`History`.
"""

from multiscale.history import History, LoadStep, PatchState
from multiscale.law_files import LawTable, read_laws, write_laws
from multiscale.laws import PatchLaw
from multiscale.run import Run, run
from multiscale.scene import Scene
from multiscale.stage import Stage, make_stage
from multiscale.tabulate import isolated_laws

__all__ = [
    "History",
    "LawTable",
    "LoadStep",
    "PatchLaw",
    "PatchState",
    "Run",
    "Scene",
    "Stage",
    "isolated_laws",
    "make_stage",
    "read_laws",
    "run",
    "write_laws",
]
