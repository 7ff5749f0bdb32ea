"""The stiffness of an interface, −dF/dū: of boundaries, couplings, energies and a dense solver.

Its thermal and electrical twins are in `test_conductance` and `test_conductance_in_scenes`.
"""

import numpy as np
import pytest
from helpers.dense_contact import dense_contact

from patchlaw import Scene, run
from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel

MODULUS = 1000.0


def stiffness(seed, kind, *, waves=4, periodic=False, patches=1, force=600.0):
    """Return the stiffness of a map of 16 cells a longest wave at half the force and all of it."""
    spectrum = {"hurst": 0.8, "waves": [waves, 4 * waves], "rms_slope": 0.1, "seed": seed}
    scene = {
        "surface": {
            "spectrum": spectrum,
            "grid": [16 * waves, 16 * waves],
            "lengths": [1.0, 1.0],
            "periodic": periodic,
        },
        "block": {"young_modulus": 200e3, "poisson_ratio": 0.3, "height": 1.0},
        "patches": {"grid": [patches, patches]},
        "coupling": {"kind": kind},
        "load": {"force": force, "steps": 2},
        "output": {"check": "none", "figures": False, "report": False},
    }
    return run(Scene.from_dict(scene)).interface_stiffness_N_per_mm


def rms(found, expected):
    return np.sqrt(np.mean((np.array(found) / np.array(expected) - 1.0) ** 2))


@pytest.mark.slow
def test_ten_surfaces_are_as_stiff_through_their_boundaries_as_their_waves_tell():
    """A period differs from a cube by one over the number of waves.

    A half-space with free sides bears less at them, however many waves there are.
    """
    off, seeds = {}, range(9401, 9411)
    for waves in (2, 4, 8):
        cube = [stiffness(seed, "concurrent", waves=waves) for seed in seeds]
        period = [stiffness(seed, "analytic", waves=waves, periodic=True) for seed in seeds]
        free = [stiffness(seed, "analytic", waves=waves) for seed in seeds]
        off[waves] = rms(period, cube)
        assert rms(free, cube) < 0.09
    assert off[2] < 0.09
    assert off[4] < off[2] / 1.6
    assert off[8] < off[4] / 1.6


@pytest.mark.slow
def test_two_couplings_of_a_scene_are_as_stiff_to_a_per_cent():
    seeds = range(9401, 9404)
    laws = [stiffness(seed, "consistent", patches=2, force=800.0) for seed in seeds]
    cells = [stiffness(seed, "concurrent", force=800.0) for seed in seeds]
    assert rms(laws, cells) < 0.011


def surface(seed, waves=(2, 8), grid=(48, 40)):
    spectrum = Spectrum(hurst=0.8, waves=waves, rms_slope=0.1, seed=seed)
    return synthesise(spectrum, grid=grid, lengths=(1.0, grid[1] / grid[0]))


@pytest.mark.parametrize("periodic", [True, False])
def test_energies_tell_the_stiffness(periodic):
    """F = dU/dδ, so that K = −U''(δ) / (dū/dδ)."""
    rough = surface(21, grid=(40, 48))
    model = HalfSpaceModel(rough, contact_modulus=MODULUS, periodic=periodic, tolerance=1e-12)
    approach = 1.6 * rough.heights.std()
    change = 2e-4 * approach
    before, state, after = (
        model.press(Control(approach=approach + way * change)) for way in (-1, 0, 1)
    )
    np.testing.assert_array_equal(before.in_contact, after.in_contact)
    second = (before.elastic_energy - 2 * state.elastic_energy + after.elastic_energy) / change**2
    closed = (before.mean_separation - after.mean_separation) / (2 * change)
    found = model.stiffness(state)
    assert found.approach == pytest.approx(second, rel=1e-6)
    assert found.interface == pytest.approx(second / closed, rel=1e-6)
    assert (found.interface > 1.2 * found.approach) is not periodic


def test_a_dense_solver_closes_the_gap_alike():
    """Love's sums of corners make a matrix; a quadratic programme on it is solved twice."""
    rough, cells = surface(7, waves=(2, 4), grid=(16, 16)), 16
    centres = (np.arange(cells) + 0.5) / cells
    x, y = (one.ravel() for one in np.meshgrid(centres, centres, indexing="ij"))
    matrix = np.zeros((cells**2, cells**2))
    for i in (1, -1):
        for j in (1, -1):
            u, v = (one[:, None] - one + 0.5 * k / cells for one, k in ((x, i), (y, j)))
            matrix += i * j * (u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v)))
    matrix /= np.pi * MODULUS
    top = rough.heights.max()
    model = HalfSpaceModel(rough, contact_modulus=MODULUS, highest=top, tolerance=1e-10)
    approach = 1.5 * rough.heights.std()
    state, near = model.press(Control(approach=approach)), []
    for way in (-1, 1):
        moved = approach * (1.0 + 1e-3 * way)
        solved = dense_contact(matrix, rough.heights - top + moved)
        near.append((solved.pressure.sum() / cells**2, solved.gap.mean()))
    (less, wide), (more, narrow) = near
    assert state.force == pytest.approx(0.5 * (less + more), rel=1e-4)
    found = model.stiffness(state).interface
    assert found == pytest.approx((more - less) / (wide - narrow), rel=1e-4)


@pytest.mark.long
def test_stiffness_rises_as_the_pressure_does():
    """Greenwood and Williamson (1966): K about p over a length next to the rms height.

    Exponential heights of summits make K σ_s / p = 1; Gaussian ones 2 to 3 at 1 to 5 % contact.
    """
    pressures, found = np.array([1.0, 2.0, 4.0]), []
    for seed in range(31, 41):
        rough = surface(seed, waves=(4, 16), grid=(64, 64))
        model = HalfSpaceModel(rough, contact_modulus=MODULUS, periodic=True)
        states = [model.press(Control(force=p)) for p in pressures]
        slopes = np.array([model.stiffness(state).interface for state in states])
        found.append(slopes * rough.heights.std() / pressures)
    mean = np.mean(found, axis=0)
    assert ((mean > 1.8) & (mean < 3.2)).all()
    powers = 1.0 + np.polyfit(np.log(pressures), np.log(mean), 1)[0]
    assert 0.8 < powers < 1.05
