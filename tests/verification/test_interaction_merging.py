"""Contacts that grow together: force continuous and increasing, nothing lost, all reported."""

import numpy as np
import pytest
from helpers.along import respond
from helpers.asperity_states import pressed
from helpers.interaction_cases import E_STAR, PATCHES, summits

from patchlaw.micro import AsperityModel

ANGLES = np.arange(6) * np.pi / 3


def scattered(seed, count, width):
    """Return asperities of random height, size and direction in a square."""
    rng = np.random.default_rng(seed)
    minor = 0.02 * np.exp(rng.normal(0.0, 0.7, count))
    return summits(
        *(0.5 + width * (rng.random((2, count)) - 0.5)),
        z=-rng.exponential(0.01, count),
        major=minor * (1.0 + rng.exponential(1.0, count)),
        minor=minor,
        angle=np.pi * rng.random(count),
    )


CASES = {
    "two equal": summits([0.48, 0.52], 0.5),
    "two unequal": summits([0.48, 0.52], 0.5, z=[0, -5e-3], major=[0.1, 0.03]),
    "two ellipses": summits([0.48, 0.52], 0.5, major=0.2, minor=0.05, angle=[0.3, 1.4]),
    "three in a line": summits([0.47, 0.5, 0.53], 0.5),
    "five in a line": summits(0.5 + 0.03 * np.arange(-2, 3), 0.5),
    "hexagon": summits(
        np.append(0.5, 0.5 + 0.03 * np.cos(ANGLES)), np.append(0.5, 0.5 + 0.03 * np.sin(ANGLES))
    ),
    "coincident": summits([0.5, 0.5, 0.5], 0.5, z=[0, 0, -1e-3], major=[0.1, 0.1, 0.05]),
    "tight cluster": scattered(0, 30, 0.03),
    "cluster": scattered(1, 30, 0.1),
    "field": scattered(2, 30, 0.3),
}
every_case = pytest.mark.parametrize("case", CASES)
both_shapes = pytest.mark.parametrize("name", ["circular", "elliptic"])


def curve(case, name, approaches):
    model = AsperityModel(name, CASES[case], contact_modulus=E_STAR)
    return respond(model, approaches, patches=PATCHES, mean_heights=np.zeros(16))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "name"),
    [
        *((case, "elliptic") for case in CASES),
        *((case, "circular") for case in ("two unequal", "hexagon", "coincident", "cluster")),
    ],
)
def test_force_grows_without_a_jump(case, name):
    approaches = np.linspace(0.0, 0.1, 61)
    response = curve(case, name, approaches)
    assert response.overlapping_contacts[-1] > 0 and response.residual.max() <= 1e-10
    increments = np.diff(response.force)
    assert np.all(increments[response.force[1:] > 0.0] > 0.0)
    # A jump would make one increment stand out from its neighbours for any step: halve the step
    # around the roughest place and see every increment shrink with it.
    rough = np.abs(np.diff(increments)) / np.maximum(increments[1:], 1e-3 * increments.max())
    at = np.argmax(rough) + 1
    fine = curve(case, name, np.linspace(approaches[at - 1], approaches[at + 1], 33))
    assert np.diff(fine.force).max() < 2.5 / 16 * increments[at - 1 : at + 1].max()


@both_shapes
@every_case
def test_result_does_not_depend_on_the_path(case, name):
    # One solution per approach: from nothing, from below and from far above.
    model = AsperityModel(name, CASES[case], contact_modulus=E_STAR)
    for approach in (0.01, 0.04):
        cold = pressed(model, approach)
        above = pressed(model, approach, start=pressed(model, 0.1).guess)
        assert above.ellipses.force == pytest.approx(
            cold.ellipses.force, rel=1e-7, abs=1e-7 * cold.ellipses.force.max()
        )


@both_shapes
@pytest.mark.parametrize(("count", "share"), [(2, 1.0), (3, 0.935), (5, 0.815)])
def test_coincident_summits_share_the_force_of_one(name, count, share):
    same, one = summits(np.full(count, 0.5), 0.5), summits(0.5, 0.5)
    all_of_them, alone = (
        pressed(AsperityModel(name, case, contact_modulus=E_STAR), 0.02) for case in (same, one)
    )
    # n (1 + (n − 1) c*)^(−3/2): exactly 1 for two by the choice of c*, three digits given else.
    tolerance = 1e-9 if count == 2 else 1e-3
    assert all_of_them.ellipses.force.sum() / alone.ellipses.force[0] == pytest.approx(
        share, rel=tolerance
    )
    assert all_of_them.overlapping_contacts == count * (count - 1)
