"""Makes representative laws: pressure over closure of periodic samples of a large face.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from patchlaw.geometry import Regions, Surface
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.of_samples import Limit, PeriodicSample, PeriodicSamples
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import MOST_ROWS, ROW_ERROR
from patchlaw.multiscale.readable import Observer
from patchlaw.support.arguments import Comm, Limits, PositiveLength, PositivePressure, checked
from patchlaw.support.errors import InputError

MakeModel = Callable[[Surface], HalfSpaceModel]


@checked
def representative_law(
    samples: Sequence[Surface],
    contact_modulus: PositivePressure,
    *,
    largest_pressure: PositivePressure | None = None,
    largest_closure: PositiveLength | None = None,
    tolerance: Annotated[float, Limits(gt=0, lt=1)] = 3e-3,
    most_rows: Annotated[int, Limits(ge=4, le=100_000)] = MOST_ROWS,
    make_model: MakeModel | None = None,
    before: PatchLaw | None = None,
    leak: bool = False,
    comm: Comm | None = None,
    observe: Observer | None = None,
) -> PatchLaw:
    """Tabulate the law of a face that is much larger than the samples of its roughness.

    The samples continue periodically on a half-space whose displacements count from their mean:
    p over z_M − mean height − mean separation is the law of the interface alone, and all long waves
    are left to the body that uses it. The law of several samples is the mean of their pressures at
    equal separations of their mean planes. Closure counts from the height z_M of the sample that
    rises highest above its mean plane.

    Args:
        samples: Periodic surfaces; they count by their areas. A map that does not continue
            periodically is `geometry.mirrored` first.
        contact_modulus: E* [MPa].
        largest_pressure: Largest local pressure that the law will be used for [MPa].
        largest_closure: Largest local closure [mm]. Of both, what is reached first ends the law.
        tolerance: Interpolation error of the pressure, see `refinement.refined`.
        most_rows: Rows that are solved at most, for each sample.
        make_model: Makes the model of a sample; by default the periodic half-space.
        before: A law of the same samples that ends too early: its rows are kept, and only what lies
            beyond them is solved.
        leak: Whether the law also has the transmissivity of the gaps, for a leak.
        comm: MPI communicator, whose ranks share samples and rows. The law does not depend on
            their number.
        observe: Called as rows are solved.

    Returns:
        The law, on every rank, parametrised by s = c + Λ p with its mean compliance Λ: the plane's
        approach where a layer of that compliance lies under the interface. The contacts are those
        of all samples together, on `sample_area`. In full contact, where the interface has no
        compliance left, the law goes on with a hundredth of its mean one. Under a hardness the law
        is that of rising loads, and ends where the plane is at the mean plane at the latest.

    Raises:
        InputError: When there is no sample, one is not periodic or flat, or no largest load is
            given.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    limits = {"largest_pressure": largest_pressure, "largest_closure": largest_closure}
    given = [np.inf if value is None else float(value) for value in limits.values()]
    if not np.isfinite(given).any():
        raise InputError(
            "a representative law needs an end",
            value=list(limits.values()),
            allowed="largest_pressure, largest_closure or both",
        )
    if not samples:
        raise InputError("a representative law needs a sample", key="samples", value=[])
    make = make_model or (
        lambda sample: HalfSpaceModel(sample, contact_modulus=contact_modulus, periodic=True)
    )
    face = PeriodicSamples(
        samples=tuple(_checked(sample, make, ROW_ERROR * tolerance) for sample in samples),
        comm=comm,
        observe=(lambda rows: observe("rows of laws", rows, most_rows)) if observe else None,
    )
    law = face.law(Limit(*given), tolerance, most_rows, before)
    return _with_leak(law, face, before) if leak else law


def _with_leak(law: PatchLaw, face: PeriodicSamples, before: PatchLaw | None) -> PatchLaw:
    """Return a law with the transmissivity of its samples; collective."""
    if before is not None and before.transmissivity is not None:
        return replace(law, transmissivity=before.transmissivity)
    from patchlaw.multiscale.laws.transmissivity import (
        sample_transmissivity,  # other laws do without
    )

    flow = sample_transmissivity(
        [sample.model for sample in face.samples],
        lambda separation: law.pressure(law.initial_separation - separation),
        face.comm,
    )
    return replace(law, transmissivity=flow)


def representative_laws(
    regions: Mapping[str, Sequence[Surface]],
    contact_modulus: float,
    *,
    before: LawTable | None = None,
    **options: Any,
) -> LawTable:
    """Tabulate the laws of all regions of a face, whose mean planes are one plane.

    Args:
        regions: Samples of each region, by its name; a face in one piece is one region.
        contact_modulus: E* [MPa].
        before: Laws of the same samples that end too early, as for `representative_law`.
        options: As for `representative_law`.

    Returns:
        One law per region. Closures of all count from the height of the region that rises highest
        above the common mean plane.

    Raises:
        InputError: When there is no region, or as for `representative_law`.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    names = Regions(tuple(regions))
    earlier = [None] * len(names.names) if before is None else before.laws
    laws = [
        representative_law(regions[name], contact_modulus, before=law, **options)
        for name, law in zip(names.names, earlier, strict=True)
    ]
    highest = max(law.initial_separation for law in laws)
    return LawTable(
        patches=names,
        laws=tuple(law.shifted(highest - law.initial_separation) for law in laws),
        made_by={
            "coupling": "representative",
            "model": "half-space-periodic",
            "love": "none",
            "tolerance": f"{options.get('tolerance', 3e-3):g}",
            "samples": ", ".join(str(len(regions[name])) for name in names.names),
        },
        force_error=max(law.interpolation_error for law in laws),
    )


def _checked(sample: Surface, make: MakeModel, error: float) -> PeriodicSample:
    if np.ptp(sample.heights) == 0.0:
        raise InputError("a flat sample has no law", value=sample.source or "flat")
    model = make(sample)
    if not model.periodic:
        raise InputError("a representative law needs periodic models", value=model.name)
    return PeriodicSample(model, error)
