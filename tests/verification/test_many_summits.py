"""Many interacting asperities: multipoles and mesh against the direct sum over all pairs."""

from dataclasses import replace

import numpy as np
import pytest
from interaction_cases import E_STAR, PATCHES

from geometry import Asperities, InputError
from micro import asperity_model
from micro.asperities.many_summits import PAIR_SUMS, ManySummits, pair_sum

both_shapes = pytest.mark.parametrize("name", ["circular", "elliptic"])


def scattered(count, seed=0, depth=2e-3):
    """Asperities at random places, some of them close together; radii of a wide spread."""
    rng = np.random.default_rng(seed)
    minor = 0.3 / count**0.5 * np.exp(rng.normal(0.0, 0.6, count))
    x, y = rng.random((2, count))
    return Asperities(
        x=x,
        y=y,
        z=-rng.exponential(depth, count),
        radius_major=minor * (1.0 + rng.exponential(1.0, count)),
        radius_minor=minor,
        angle=np.pi * rng.random(count),
        lengths=(1.0, 1.0),
        highest=0.0,
        mean_height=-0.02,
    )


def split(interaction, way, indentation):
    many, every = ManySummits(interaction=interaction), np.arange(len(indentation))
    return many._parts(way, every, interaction, indentation)


@both_shapes
@pytest.mark.parametrize(
    ("way", "worst", "mean"), [("multipole", 1e-11, 1e-11), ("mesh", 1e-5, 2e-6)]
)
@pytest.mark.parametrize("size", [2e-5, 1e-3])
def test_displacements(name, way, worst, mean, size):
    model = asperity_model(name, scattered(1500), contact_modulus=E_STAR)
    t = size * np.random.default_rng(1).random(1500)
    t[::3] = 0.0
    exact = model.contacts.interaction.lift(t)
    lift = split(model.contacts.interaction, way, t).lift(t)
    error = np.abs(lift.displacement - exact.displacement) / exact.displacement.mean()
    assert error.max() < worst and np.sqrt(np.mean(error**2)) < mean
    assert lift.overlapping_contacts == exact.overlapping_contacts
    assert lift.active.tolist() == exact.active.tolist()
    # Products take distant contacts as point forces: 1e-2 suffices for the iteration.
    change = np.zeros(1500)
    change[exact.active] = np.random.default_rng(2).random(len(exact.active))
    slow = exact.slope @ change[exact.active]
    assert lift.product(change) == pytest.approx(slow, abs=1e-2 * slow.mean())


@both_shapes
def test_solutions(name):
    some = asperity_model(name, scattered(700), contact_modulus=E_STAR)
    approaches = np.array([5e-4, 1e-3, 3e-3, 6e-3])
    curve = {
        way: replace(some, pairs=way).respond(
            approaches, patches=PATCHES, mean_heights=np.zeros(16)
        )
        for way in PAIR_SUMS
    }
    direct = curve["direct"]
    assert direct.contacts[-1] > 300 and direct.overlapping_contacts[-1] > 0
    for way, tolerance in (("multipole", 1e-9), ("mesh", 1e-5)):
        # Solved to 1e-10 of the approach, the multipoles good to 1e-11, the mesh to 1e-5.
        assert curve[way].force == pytest.approx(direct.force, rel=tolerance)
        assert curve[way].patch_force == pytest.approx(direct.patch_force, rel=10 * tolerance)
        assert curve[way].contact_area == pytest.approx(direct.contact_area, rel=tolerance)
        assert np.abs(curve[way].overlapping_contacts - direct.overlapping_contacts).max() <= (
            way == "mesh"
        )
        assert curve[way].residual.max() <= 1e-10


def test_state_of_very_many():
    # Above 2000 summits also those out of reach are displaced through the mesh.
    many = scattered(2600, depth=5e-3)
    model = asperity_model("elliptic", many, contact_modulus=E_STAR)
    state = model.solve(1e-3)
    exact = state.indentation + model.contacts.interaction.lift(state.indentation).displacement
    assert np.abs(state.displacement - exact).max() < 1e-5 * exact.mean()
    warm = model.solve(1.02e-3, start=state)
    assert warm.force.sum() > state.force.sum()


def test_closeness_is_corrected():
    # A start far below the solution underestimates which pairs are close.
    model = asperity_model("circular", scattered(300), contact_modulus=E_STAR)
    required = np.maximum(4e-3 + model.asperities.z, 0.0)
    reached = np.flatnonzero(required > 0.0)
    many = ManySummits(interaction=model.contacts.interaction)
    cold = many.solve("multipole", reached, required[reached], np.zeros(len(reached)))
    exact = replace(model, pairs="direct").solve(4e-3).indentation[reached]
    assert cold.indentation == pytest.approx(exact, abs=1e-9 * 4e-3)


def test_line_of_summits():
    line = replace(scattered(400), y=np.full(400, 0.5), x=np.linspace(0.01, 0.99, 400))
    model = asperity_model("elliptic", line, contact_modulus=E_STAR)
    direct, mesh = (replace(model, pairs=way).solve(2e-3).force.sum() for way in ("direct", "mesh"))
    assert mesh == pytest.approx(direct, rel=1e-5)


def test_choice():
    assert [pair_sum(n) for n in (0, 150, 151, 2000, 2001, 10**6)] == [
        "direct", "direct", "multipole", "multipole", "mesh", "mesh",
    ]  # fmt: skip
    few = scattered(3)
    with pytest.raises(InputError, match=r"'tree': this sum over pairs.*auto, direct, multipole"):
        replace(asperity_model("circular", few, contact_modulus=1.0), pairs="tree")
    paper = asperity_model("circular", few, contact_modulus=1.0, solver="truncated-newton")
    with pytest.raises(InputError, match=r"'mesh'.*truncated-newton is unknown.*auto, direct"):
        replace(paper, pairs="mesh")
