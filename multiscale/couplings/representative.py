"""Laws of periodic samples on the contact face of a scene's body.

Theory: docs/theory.md, sections 10 and 11.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, Surface
from micro import FiniteSlopes, HalfSpaceModel
from multiscale.couplings.law_couplings import EmbeddedCoupling
from multiscale.couplings.patch_compliance import embedding
from multiscale.laws.law_table import LawTable
from multiscale.laws.representative import representative_laws
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import BeyondLaws
from multiscale.readable import Observer
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.samples import RegionSamples

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, LawContactProblem, LoadedFace

Array = NDArray[np.float64]

_CONCENTRATION = 10.0
"""Largest local pressure that laws are made for, over the mean one on the face."""
_CROWNED = 2.0
"""The same over the largest pressure of smooth crowned bodies (Hertz), which roughness lowers."""
_YIELDED = 0.95
"""Largest pressure of laws under a hardness, relative to it: nearly all cells bear the hardness
then, and at it the pressure is no function of closure."""
_EXTENSION = 2.0
"""Largest pressure of laws that turned out to end too early, over that of the earlier ones."""
_RESERVE = 0.15
"""Closure that laws are made for beyond the largest approach on the face, relative to it."""


def face_laws(
    setup: ProblemSetup,
    comm: Any,
    observe: Observer | None = None,
    *,
    before: LawTable | None = None,
) -> LawTable:
    """Tabulate the laws of the samples of a scene, one for each region of its face.

    Args:
        setup: The problem set up from the scene, with laws of samples.
        comm: MPI communicator; None for this process alone.
        observe: Called as rows are made.
        before: Laws that end too early. They are extended to twice their largest pressure, or as
            far as the material allows; where that is no further they come back as they are.

    Raises:
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    hardness = setup.scene.micro.hardness
    most = math.inf if hardness is None else _YIELDED * hardness
    if before is None or not (reached := before.largest_pressure):
        pressure, closure = largest_loads(setup, comm)
    else:
        pressure, closure = _EXTENSION * reached, None
        most = min(most, setup.materials.contact_modulus)
    pressure = min(pressure, most)
    models = {
        id(one): _model(setup, region, one) for region in setup.samples for one in region.surfaces
    }
    found = representative_laws(
        {region.name: region.surfaces for region in setup.samples},
        setup.materials.contact_modulus,
        largest_pressure=pressure,
        largest_closure=closure,
        tolerance=setup.table_tolerance,
        most_rows=setup.table_rows,
        make_model=lambda sample: models[id(sample)],
        before=before,
        comm=comm,
        observe=observe,
    )
    if before is not None and found.rows == before.rows:
        return before
    return found


def _model(setup: ProblemSetup, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
    """Return the periodic model of a sample, with the slopes of its body where they count."""
    pair = region.materials
    assert isinstance(setup.model, HalfSpaceModel)
    model = replace(setup.model, surface=sample, contact_modulus=pair.contact_modulus)
    if not setup.finite_slopes:
        return model
    return replace(model, slopes=FiniteSlopes(sample, pair.first, periodic=True))


def largest_loads(setup: ProblemSetup, comm: Any) -> tuple[float, float | None]:
    """Return the largest local pressure that laws are made for [MPa], and closure [mm].

    The closure is None where only a force, or other loads of the body, would tell it.

    Args:
        setup: The problem set up from the scene, with laws of samples.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    assert setup.face is not None
    stated, face = setup.scene.law.largest_pressure, setup.face
    history, body = setup.load_history, setup.bodies.first
    if history.quantity == "force":
        force = history.largest
        mean = force / face.area
        return stated or max(_CONCENTRATION * mean, _hertz(setup, force=force)), None
    tilt = history.tilt or (0.0, 0.0)
    approach = history.largest + 0.5 * float(np.abs(np.multiply(face.lengths, tilt)).sum())
    mean = approach / mean_compliance(setup, comm)
    pressure = stated or max(_CONCENTRATION * mean, _hertz(setup, approach=approach))
    preloaded = body is not None and body.body.preload is not None
    return pressure, None if preloaded else (1.0 + _RESERVE) * approach


def mean_compliance(setup: ProblemSetup, comm: Any) -> float:
    """Return the mean displacement of a face by a uniform unit pressure [mm/MPa].

    Args:
        setup: The problem set up from the scene, with laws of samples.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from macro import FacePair, displacements_under

    face = embedding(setup, comm)
    total = 0.0
    for one in (face.first, face.second) if isinstance(face, FacePair) else (face,):
        found = displacements_under(one, np.ones((1, one.patches.count)))[0]
        total += float(found @ one.areas / one.areas.sum())
    return total


def _hertz(setup: ProblemSetup, *, force: float = 0.0, approach: float = 0.0) -> float:
    """Return a bound of the pressure between smooth crowned bodies; 0 without a crown [MPa].

    Source:
        Johnson, Contact Mechanics (1985), eq. 4.24, 4.25 and 4.45.
    """
    radii = [one for one in setup.scene.law.crown or () if one != "inf"]
    if not radii:
        return 0.0
    assert setup.face is not None
    modulus, radius = setup.materials.contact_modulus, math.sqrt(math.prod(radii))
    if len(radii) == 1:
        radius, length = radii[0], min(setup.face.lengths)
        line = math.sqrt(force / length * modulus / (math.pi * radius))
        return _CROWNED * max(line, modulus * math.sqrt(0.5 * approach / radius))
    point = (6.0 * force * modulus**2 / (math.pi**3 * radius**2)) ** (1.0 / 3.0)
    return _CROWNED * max(point, 2.0 / math.pi * modulus * math.sqrt(approach / radius))


class FaceCoupling(EmbeddedCoupling):
    """Laws of samples on the contact face of a body; they are extended where a load step needs it.

    Args:
        setup: The problem set up from the scene, with laws of samples.
        table: The laws.
        comm: MPI communicator; None for this process alone.

    Note:
        Construction and all methods are collective.
    """

    def __init__(self, setup: ProblemSetup, table: LawTable, comm: Any) -> None:
        self._setup, self._comm = setup, comm
        face = embedding(setup, comm)
        super().__init__(self._problem_with(table, face), table, face)

    def press(self, control: Control) -> LoadStep:
        """Solve one load step, with longer laws where these end too early."""
        while True:
            try:
                return super().press(control)
            except BeyondLaws:
                longer = face_laws(self._setup, self._comm, before=self.table)
                if longer is self.table:
                    raise
                last = self.state()
                self.table, self._problem = longer, self._problem_with(longer, self.face)
                self.restore(last)

    def _problem_with(self, table: LawTable, face: LoadedFace | FacePair) -> LawContactProblem:
        from macro import FacePair, LawContactProblem

        problem = LawContactProblem(face, table.laws, mode="pointwise", crown=crown(self._setup))
        if not isinstance(face, FacePair):  # such laws are steep: 3 steps of Newton instead of 11
            problem.start_from(np.ones(face.patches.count))
        return problem


def crown(setup: ProblemSetup) -> Callable[[Array, Array], Array] | None:
    """Return the depth of a crowned face at points of its plane [mm]; None where it has none.

    Args:
        setup: The problem set up from the scene, with laws of samples.
    """
    radii = setup.scene.law.crown
    if radii is None or setup.face is None:
        return None
    middle = 0.5 * np.asarray(setup.face.lengths)
    curvature = [0.0 if one == "inf" else 1.0 / float(one) for one in radii]

    def depth(x: Array, y: Array) -> Array:
        return 0.5 * (curvature[0] * (x - middle[0]) ** 2 + curvature[1] * (y - middle[1]) ** 2)

    return depth
