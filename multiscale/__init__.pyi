"""Public names of the package and their modules, for type checkers and for `multiscale` itself."""

from multiscale.couplings.reference import ReferenceCoupling as ReferenceCoupling
from multiscale.exports.export import export_laws as export_laws
from multiscale.law_solvers.condensed import CondensedLaws as CondensedLaws
from multiscale.laws.consistent import consistent_laws as consistent_laws
from multiscale.laws.isolated import isolated_laws as isolated_laws
from multiscale.laws.law_file import read_laws as read_laws
from multiscale.laws.law_file import write_laws as write_laws
from multiscale.laws.law_table import LawTable as LawTable
from multiscale.laws.patch_law import PatchLaw as PatchLaw
from multiscale.laws.patch_law import PatchLaws as PatchLaws
from multiscale.laws.representative import representative_law as representative_law
from multiscale.laws.representative import representative_laws as representative_laws
from multiscale.loading.load_history import LoadHistory as LoadHistory
from multiscale.loading.load_step import LoadStep as LoadStep
from multiscale.loading.stepper import load_steps as load_steps
from multiscale.results.extrapolation import extrapolated as extrapolated
from multiscale.results.history import History as History
from multiscale.results.reading import read_history as read_history
from multiscale.run import Run as Run
from multiscale.run import run as run
from multiscale.scene.scene import Scene as Scene
from multiscale.setup import make_setup as make_setup
from multiscale.studies.comparison import Comparison as Comparison
from multiscale.studies.comparison import compare as compare
from multiscale.studies.sweep import SweepResults as SweepResults
from multiscale.studies.sweep import sweep as sweep
