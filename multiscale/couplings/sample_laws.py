"""Makes the laws of the samples of a face, as far as its loads need them.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from geometry import Surface
from micro import FiniteSlopes, HalfSpaceModel
from multiscale.bodies.bodies import Bodies
from multiscale.inputs.surfaces import RegionSamples
from multiscale.laws.law_table import LawTable
from multiscale.laws.refinement import MOST_ROWS
from multiscale.laws.representative import representative_laws
from multiscale.readable import Observer


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleLaws:
    """The laws of the samples of a face.

    Args:
        bodies: The bodies, with what is known of their scene.
        samples: The samples of every region of the face.
        model: Micro model of the first sample, the periodic half-space.
        tolerance: Interpolation error of the laws.
    """

    bodies: Bodies
    samples: tuple[RegionSamples, ...]
    model: HalfSpaceModel
    tolerance: float

    @property
    def _modulus(self) -> float:
        return self.bodies.parts.materials.contact_modulus

    def table(self, observe: Observer | None, before: LawTable | None = None) -> LawTable:
        """Tabulate the laws, or extend earlier ones as far as the material allows.

        Args:
            observe: Told of rows as they are made.
            before: Laws that end too early; where they end as far as possible they come back.

        Note:
            Collective.
        """
        hardness = self.model.hardness
        # near the hardness nearly all cells bear it, and at it there is no function of closure
        most = math.inf if hardness is None else 0.95 * hardness
        if before is None or not (reached := before.largest_pressure):
            pressure, closure = self.largest_loads()
        else:
            pressure, closure = 2.0 * reached, None
            most = min(most, self._modulus)
        models = {
            id(one): self._model_of(region, one)
            for region in self.samples
            for one in region.surfaces
        }
        made = representative_laws(
            {region.name: region.surfaces for region in self.samples},
            self._modulus,
            largest_pressure=min(pressure, most),
            largest_closure=closure,
            tolerance=self.tolerance,
            most_rows=MOST_ROWS,
            make_model=lambda sample: models[id(sample)],
            before=before,
            comm=self.bodies.comm,
            observe=observe,
        )
        return before if before is not None and made.rows == before.rows else made

    def _model_of(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        """Return the periodic model of a sample, with the slopes of its body where they count."""
        pair = region.materials
        model = replace(self.model, surface=sample, contact_modulus=pair.contact_modulus)
        if not self.bodies.parts.finite_slopes:
            return model
        return replace(model, slopes=(FiniteSlopes(sample, pair.first, periodic=True),))

    def largest_loads(self) -> tuple[float, float | None]:
        """Return the largest local pressure that laws are made for [MPa], and closure [mm].

        The closure is None where only a force, or other loads of the body, would tell it.

        Note:
            Collective.
        """
        parts = self.bodies.parts
        stated, history, face = parts.scene.law.largest_pressure, parts.load_history, parts.body
        if history.quantity == "force":
            force = history.largest
            mean = force / face.area
            return stated or self._peak(mean, force=force), None
        tilt, lengths = history.slopes or (0.0, 0.0), face.lengths
        approach = history.largest + 0.5 * float(np.abs(np.multiply(lengths, tilt)).sum())
        mean = approach / self.mean_compliance()
        pressure = stated or self._peak(mean, approach=approach)
        first = self.bodies.first
        preloaded = first is not None and first.body.preload is not None
        return pressure, None if preloaded else 1.15 * approach

    def mean_compliance(self) -> float:
        """Return the mean displacement of the face by a uniform unit pressure [mm/MPa].

        Note:
            Collective.
        """
        from macro import FacePair, displacements_under

        face, total = self.bodies.contact_face(), 0.0
        for one in (face.first, face.second) if isinstance(face, FacePair) else (face,):
            moved = displacements_under(one, np.ones((1, one.patches.count)))[0]
            total += float(moved @ one.areas / one.areas.sum())
        return total

    def _peak(self, mean: float, *, force: float = 0.0, approach: float = 0.0) -> float:
        """Return the largest local pressure that laws are made for [MPa].

        It is ten times the mean pressure on the face, or twice the largest pressure of the smooth
        crowned bodies, which roughness lowers.

        Source:
            Johnson, Contact Mechanics (1985), eq. 4.24, 4.25 and 4.45.
        """
        radii = [one for one in self.bodies.parts.scene.law.crown or () if one != "inf"]
        if not radii:
            return 10.0 * mean
        modulus, radius = self._modulus, math.sqrt(math.prod(radii))
        if len(radii) == 1:
            radius, length = radii[0], min(self.bodies.parts.body.lengths)
            peak = math.sqrt(force / length * modulus / (math.pi * radius))
            under_approach = modulus * math.sqrt(0.5 * approach / radius)
        else:
            peak = (6.0 * force * modulus**2 / (math.pi**3 * radius**2)) ** (1.0 / 3.0)
            under_approach = 2.0 / math.pi * modulus * math.sqrt(approach / radius)
        return max(10.0 * mean, 2.0 * max(peak, under_approach))
