"""Hard surfaces: spikes, steps, plateaus, gaps, empty patches, meshes with no contact node."""

import numpy as np
import pytest
from helpers.hard_cases import centred, coarse_tables, from_file, history, scene
from helpers.laws_on_mesh import lay_on_mesh

from patchlaw.geometry import read_surface
from patchlaw.geometry.filters import filled
from patchlaw.multiscale import make_setup
from patchlaw.support import InputError, NotConverged

X, Y = centred(32)
DOME = -(X**2 + Y**2) / 0.8
SPIKE = 0.1 * DOME
SPIKE[7, 9] += 0.02
CELL = np.zeros((32, 32))
CELL[16, 16] = 0.01
SURFACES = {
    "spike": SPIKE,
    "step": np.where(X > 0.0, 0.01, 0.0) + 0.0 * Y,
    "plateau": np.minimum(DOME, -0.02),
    "single cell": CELL,
    "flat": np.zeros((32, 32)),
}


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.long] * (n in ("step", "plateau"))) for n in SURFACES],
)
def test_couplings_agree_on_surfaces_that_are_not_smooth(name, tmp_path):
    # hard: whole flat regions touch at once, or a single cell carries all
    surface = from_file(tmp_path, SURFACES[name])
    found = {
        kind: history(
            coupling__kind=kind, micro__finite_slopes=False, **surface, **coarse_tables(kind)
        )
        for kind in ("isolated", "consistent", "concurrent")
    }
    force = found["concurrent"].force_N[-1]
    assert force > 0.0
    # patches of eight cells take flat punches for even pressures; see README, how accurate
    assert found["consistent"].force_N[-1] == pytest.approx(force, rel=0.02)
    assert found["isolated"].force_N[-1] == pytest.approx(force, rel=0.5)
    assert all(found[kind].newton_iterations.max() <= 12 for kind in ("isolated", "consistent"))


@pytest.mark.long
def test_a_flat_patch_alone_needs_the_compliance_of_the_patches(tmp_path, monkeypatch):
    # hard: closure falls from first touch on, and nothing is a function of it
    surface = from_file(tmp_path, SURFACES["flat"]) | {"patches__grid": [2, 2]}
    with pytest.raises(InputError, match="no summit that could carry load"):
        history(micro__model="elliptic", **surface)
    assert history(coupling__kind="isolated", **surface).force_N[-1] > 0.0
    lay_on_mesh(monkeypatch)
    with pytest.raises(NotConverged, match=r"function of closure nowhere.*kind = 'consistent'"):
        history(coupling__kind="isolated", **surface)


@pytest.mark.parametrize("kind", ["concurrent", pytest.param("consistent", marks=pytest.mark.slow)])
def test_full_contact_is_as_stiff_as_a_flat_surface(kind, tmp_path):
    # hard: the law saturates; beyond full contact only the block is compressed
    flat = from_file(tmp_path, np.zeros((16, 16)))
    load = {
        "coupling__kind": kind, "block__height": "3 mm", "patches__grid": [2, 2],
        "load__approach": ["2 mm", "2.2 mm"],
    }  # fmt: skip
    rough, even = (history(**load, **one) for one in ({"surface__grid": [16, 16]}, flat))
    stiffness = [float(np.diff(one.force_N)[0]) for one in (rough, even)]
    assert rough.contact_area_fraction[-1] > 0.95
    assert stiffness[0] == pytest.approx(stiffness[1], rel=5e-3)


def test_patches_with_nothing_in_them(tmp_path):
    # hard: all load on one patch of sixteen; the partition must not change what is concurrent
    surface = from_file(tmp_path, np.kron(CELL, np.ones((2, 2))))
    surface["micro__finite_slopes"] = False
    laws = history(coupling__kind="consistent", **surface)
    pressed = laws.patch_pressure_MPa[-1] > 0.0
    assert np.count_nonzero(pressed) == 1
    forces = [
        history(coupling__kind="concurrent", patches__grid=grid, **surface).force_N[-1]
        for grid in ([1, 1], [4, 4], [16, 16])
    ]
    np.testing.assert_allclose(forces, forces[0], rtol=1e-12)  # rounding
    assert laws.force_N[-1] == pytest.approx(forces[0], rel=1e-3)


def test_noise_between_the_heights_is_told(tmp_path):
    # hard: a spline through white noise rises far above all heights, and approach counts from it
    noise = 3e-3 * np.random.default_rng(0).standard_normal((32, 32))
    told = list(make_setup(scene(**from_file(tmp_path, noise))).about.warnings())
    assert any("too coarse or too noisy" in one for one in told)


def with_gaps(heights):
    heights = heights.copy()
    heights[3:6, 3:6] = np.nan
    heights[20:30, 0:4] = np.nan  # on the border
    return heights


def test_missing_heights_are_refused_or_filled_on_request(tmp_path):
    gaps = from_file(tmp_path, with_gaps(DOME))
    with pytest.raises(InputError, match=r"49 of 1024 heights are missing.*missing = 'fill'"):
        history(**gaps)
    made = make_setup(scene(surface__missing="fill", micro__finite_slopes=False, **gaps))
    said = dict(made.about.statements())["surface"]
    assert "4.79 % of the heights missing and filled by a membrane" in said
    # the summit is not in a gap, and what is filled nowhere rises above what is around it; slopes
    # of what does not touch would count, too
    small = {"micro__finite_slopes": False}
    whole = history(**small, **from_file(tmp_path, DOME)).force_N[-1]
    gaps = from_file(tmp_path, with_gaps(DOME))
    filled_in = history(surface__missing="fill", **small, **gaps).force_N[-1]
    assert filled_in == pytest.approx(whole, rel=1e-6)
    with pytest.raises(InputError, match="'missing' needs a 'file'"):
        scene(surface__missing="fill")


def test_the_membrane_is_harmonic():
    # linear functions and x² − y² are harmonic, and five-point differences are exact for both
    x, y = (np.arange(12) + 0.5)[:, None] / 12, (np.arange(9) + 0.5) / 18
    for heights in (0.3 * x - 0.7 * y + 2.0, x**2 - y**2):
        torn = heights.copy()
        torn[2:7, 3:6] = torn[8, 1:3] = np.nan
        found, share = filled(torn, (1 / 12, 1 / 18))
        np.testing.assert_allclose(found, heights, atol=1e-14)  # rounding
        assert share == pytest.approx(17 / 108)
    same, none = filled(heights, (1.0, 1.0))
    assert none == 0.0 and np.array_equal(same, heights)
    with pytest.raises(InputError, match="all heights are missing"):
        filled(np.full((4, 4), np.nan), (1.0, 1.0))


def test_the_membrane_stays_between_what_is_around_it():
    heights = np.random.default_rng(1).standard_normal((20, 20))
    torn = heights.copy()
    torn[:, 5:15] = np.nan  # over the border
    torn[10, :] = heights[10]
    found, _ = filled(torn, (2.0, 1.0))
    known = torn[np.isfinite(torn)]
    assert known.min() <= found.min() and found.max() <= known.max()


def test_infinite_heights_are_missing(tmp_path):
    path = tmp_path / "heights.npy"
    np.save(path, np.where(np.eye(8) > 0, np.inf, 0.0))
    with pytest.raises(InputError, match="8 of 64 heights are missing"):
        read_surface(path, lengths=(1.0, 1.0))
    # the others are level: they were once taken for all
    surface = read_surface(path, lengths=(1.0, 1.0), missing="fill")
    assert np.all(surface.heights == 0.0) and "12.5 % of the heights missing" in surface.source


@pytest.mark.long
@pytest.mark.parametrize("method", ["active-set", "augmented-lagrangian"])
def test_a_reference_too_coarse_for_any_contact_node_says_so(method):
    # hard: the plane lies below the highest point, and passes between all nodes above it
    coarse = {
        "coupling__kind": "reference",
        "reference__fine": 1.0,
        "block__element": "P1",
        "reference__method": method,
    }
    found = history(load__approach="0.2 um", **coarse)
    assert found.force_N[-1] == 0.0 and found.contacts[-1] == 0
    notes = " ".join(found.notes)
    assert "no node of the finest mesh touches in 1 of 1 load steps" in notes
    assert "no contact on any mesh, no error bar" in notes
    assert np.isnan([found.force_error_N[-1], found.contact_area_fraction_error[-1]]).all()
    forced = history(load__approach=None, load__force=["0.5 N", "0 N"], **coarse)
    assert forced.force_N == pytest.approx([0.5, 0.0], abs=1e-10)
    assert "no node of the finest mesh" not in " ".join(forced.notes[:2])
    assert forced.force_error_N[-1] == forced.contact_area_fraction_error[-1] == 0.0  # prescribed
