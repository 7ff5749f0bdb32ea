"""Hard blocks: nearly incompressible, auxetic, in any unit, flat, slender, with a bad cell."""

import numpy as np
import pytest
from helpers.block_cases import block_of
from helpers.hard_cases import coarse_tables, force_on_exact_block, history, scene
from helpers.laws_on_mesh import lay_on_mesh
from mpi4py import MPI

from patchlaw.macro import Block, Material, block_mesh
from patchlaw.multiscale import make_setup


def stiffness(element, cells, nu):
    return history(
        coupling__kind="isolated", patches__grid=[2, 2],
        surface__grid=[16, 16], block__poisson_ratio=nu, block__element=element,
        block__cells=cells,
    ).force_N[-1]  # fmt: skip


@pytest.mark.slow
def test_quadratic_elements_do_not_lock():
    # hard: at ν = 0.4999 trilinear cells are half as stiff again; the remedy is the element
    linear = [stiffness("Q1", [n, n, n], 0.4999) for n in (4, 8)]
    quadratic = [stiffness("Q2", [n, n, n], 0.4999) for n in (2, 4, 8)]
    exact = force_on_exact_block(
        patches__grid=[2, 2], surface__grid=[16, 16], block__poisson_ratio=0.4999
    )
    assert min(linear) > 1.25 * exact  # locked
    steps = np.abs(np.diff(quadratic)) / exact
    assert quadratic[-1] == pytest.approx(exact, rel=0.03)  # both meshes leave about 1 %
    assert steps[1] < 0.65 * steps[0]  # the jump of pressure at a patch's border leaves rate 1


@pytest.mark.long
@pytest.mark.parametrize("nu", [pytest.param(0.0, marks=pytest.mark.slow), -0.5])
def test_blocks_that_do_not_bulge(nu):
    # hard: cells couple differently; the witness is the half-space in closed form and its rest
    laws = {"block__poisson_ratio": nu, "patches__grid": [2, 2]} | coarse_tables("isolated")
    mesh = history(coupling__kind="isolated", block__element="Q2", **laws).force_N[-1]
    assert mesh == pytest.approx(force_on_exact_block(**laws), rel=5e-3)


@pytest.mark.parametrize(
    ("element", "nu", "told"), [("P1", 0.46, 1), ("P2", 0.49, 0), ("P1", 0.4, 0)]
)
def test_the_plan_says_that_linear_elements_lock(element, nu, told):
    material = {"block__element": element, "block__poisson_ratio": nu}
    plain = scene(coupling__kind="isolated", **material)
    meshed = scene(coupling__kind="reference", **material)
    for one in (plain, meshed):
        assert (
            sum("linear elements lock" in text for text in make_setup(one).about.warnings()) == told
        )
    split = list(make_setup(scene(block__poisson_ratio=0.4999)).about.warnings())
    assert not any("lock" in one for one in split)  # its elements are of high order
    assert any("0.4999 takes up to 22 times the iterations of 0.45" in one for one in split)
    widens = make_setup(scene(block__poisson_ratio=-0.3)).about.warnings()
    assert any("-0.3 is negative, which few materials have" in one for one in widens)


@pytest.mark.slow
@pytest.mark.parametrize("way", [{"coupling__interface": "pointwise"}, {"reference__meshes": 1}])
def test_metres_and_micrometres(way):
    # hard: lengths that no power of two scales, so that every rounding is another one; other
    # couplings are scaled among the twins of scenes
    kind = "reference" if "reference__meshes" in way else "isolated"

    def measured(unit, size):
        edges = {"reference__fine": f"{50 * size} um"} if kind == "reference" else {}
        return history(
            surface__lengths=[f"1 {unit}"] * 2, block__height=f"1 {unit}", surface__grid=[16, 16],
            patches__grid=[2, 2], load__approach=f"{8 * size} um", block__young_modulus="4e9 Pa",
            coupling__kind=kind, **way, **edges, **coarse_tables(kind),
        )  # fmt: skip

    here, there = measured("mm", 1.0), measured("um", 1e-3)
    assert there.force_N[-1] / 1e-6 == pytest.approx(here.force_N[-1], rel=1e-10)
    pressure = here.patch_pressure_MPa[-1]
    limit = 1e-10 * pressure.max()
    np.testing.assert_allclose(there.patch_pressure_MPa[-1], pressure, rtol=0.0, atol=limit)


def test_a_slender_column_adds_its_own_length():
    # hard: 50 : 1; with the whole surface the column's yielding is in series, F h (1/EA + e²/EI)
    column = history(coupling__kind="concurrent", block__height="50 mm")
    force = column.force_N[-1]
    alone = history(coupling__kind="analytic", load__approach=None, load__force=[force])
    last = column.steps[-1]
    arm = np.hypot(*last.moment_N_mm) / force  # the plane stays level: the column bends by F arm
    length = 50.0 * force / 4000.0 * (1.0 + 12.0 * arm**2)
    # end zones of about half a width, and contacts that know no sides: 2.6 % was measured
    assert column.approach_mm[-1] - alone.approach_mm[-1] == pytest.approx(length, rel=0.04)
    assert column.newton_iterations.max() <= 50  # conjugate gradients, 38 were counted


@pytest.mark.long
@pytest.mark.parametrize(("height", "bound"), [("0.02 mm", 8), ("50 mm", 8)])
def test_flat_and_slender_blocks_on_the_mesh(height, bound, monkeypatch):
    # hard: cells of 50 : 1; geometric multigrid coarsens where planes are close
    lay_on_mesh(monkeypatch)
    # Newton's steps alone, without a stiffness
    block = {"coupling__kind": "isolated", "block__height": height, "output__contact": "none"}
    found = history(**block, **coarse_tables("isolated"))
    assert found.linear_iterations.sum() <= bound * max(found.newton_iterations.sum(), 1)
    assert abs(found.steps[-1].imbalance) < 1e-9  # the residual is 1e-10 of the load


@pytest.mark.long
def test_love_on_a_patch_as_large_as_the_block():
    # hard: the half-space inside the law is none; warned, and the error is this
    large = {"patches__grid": [1, 1], "block__height": "0.2 mm"}
    told = list(make_setup(scene(coupling__kind="isolated", **large)).about.warnings())
    assert any("not small against the block" in one for one in told)
    right = history(coupling__kind="concurrent", **large).force_N[-1]
    wrong = history(coupling__kind="isolated", **large, **coarse_tables("isolated")).force_N[-1]
    assert 0.02 < abs(wrong / right - 1.0) < 0.5


@pytest.mark.parametrize("element", ["Q1", "P1"])
def test_one_very_bad_cell(iterations, element):
    # hard: a node moved until the cells beside it keep a fiftieth of their height
    block = block_of(element=element, cells=(6, 6, 4))
    good = iterations(block)
    mesh = block_mesh(block.mesh.shape, MPI.COMM_SELF)
    x = mesh.mesh.geometry.x
    node = int(np.argmin(np.abs(x - np.array([0.5, 0.5, -0.5])).sum(axis=1)))
    x[node, 2] += 0.98 * 0.25
    bad = Block(mesh, Material(young_modulus=4000.0, poisson_ratio=0.15))
    assert iterations(bad) <= 3 * good + 10
