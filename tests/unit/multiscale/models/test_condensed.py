"""The condensed block against the full Newton on the same mesh and laws."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers.laws_on_mesh import lay_on_mesh
from petsc4py import PETSc

from patchlaw.multiscale import Run, Scene, make_setup, run
from patchlaw.multiscale.models.loaded_patches import whole_stiffness
from patchlaw.support import NotConverged

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
SMALL = [
    "surface.grid=[64, 64]", "block.cells=[8, 8, 5]", "patches.grid=[4, 2]", "load.steps=3",
]  # fmt: skip
LOADS = {"level": [], "tilted": ["load.tilt=['6 um/mm', '-3 um/mm']"], "free": ["load.tilt=free"]}
MANY = ["patches.grid=[64, 64]", "block.cells=[64, 64, 4]", "micro.model=half-space"]
FORCES = {"approach": {}, "force": {"force": "2 N", "approach": None}}


def scene(*overrides, **load):
    laws = "coupling.table_tolerance=0.01"
    data = Scene.load(PAPER, [*SMALL, laws, *overrides]).to_dict()
    data["load"] |= load
    return Scene.from_dict(data)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tilt", "load"),
    [
        pytest.param(LOADS[tilt], FORCES[load], id=f"{tilt}-{load}")
        for tilt, load in (("level", "approach"), ("tilted", "force"), ("free", "force"))
    ],
)
def test_both_newtons_find_the_same_equilibrium(tilt, load, monkeypatch):
    small = ["block.cells=[4, 4, 3]", "load.steps=2", *tilt]
    condensed = run(scene(*small, **load))
    lay_on_mesh(monkeypatch)
    full = run(scene(*small, **load))
    # residuals of the mesh are driven to 1e-10 of the load, its solver for the compliance alike
    force = full.force_N.max()
    np.testing.assert_allclose(condensed.force_N, full.force_N, rtol=1e-8, atol=1e-10 * force)
    largest = full.patch_pressure_MPa.max()
    np.testing.assert_allclose(
        condensed.patch_pressure_MPa, full.patch_pressure_MPa, atol=1e-8 * largest
    )
    arms = 1e-8 * force
    np.testing.assert_allclose(condensed.moment_x_N_mm, full.moment_x_N_mm, atol=arms)
    np.testing.assert_allclose(condensed.moment_y_N_mm, full.moment_y_N_mm, atol=arms)
    # a free plane that swings clear of the surface has no tilt of its own
    loaded = full.force_N > 1e-6 * force
    assert loaded[-1]
    for name in ("approach_mm", "contact_area_fraction", "mean_separation_mm", "tilt_x", "tilt_y"):
        one, other = getattr(condensed, name)[loaded], getattr(full, name)[loaded]
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-12)  # Hertz: δ ~ P^(2/3), twice
    if "force" in load:
        np.testing.assert_allclose(condensed.force_N, [1.0, 2.0], rtol=1e-11)


def compliance(cells, element="Q1"):
    bodies = make_setup(scene(f"block.cells={cells}", f"block.element={element}")).bodies
    return bodies.compliance_under(np.arange(8))


def exact_compliance(cells):
    return make_setup(scene(f"block.cells={cells}")).bodies.patch_compliance()


@pytest.mark.long
def test_a_users_loose_solver_leaves_nothing_to_later_runs(monkeypatch, tmp_path):
    monkeypatch.setenv("PATCHLAW_CACHE", str(tmp_path))
    tetrahedra = partial(compliance, [4, 4, 2], "P1")
    options = PETSc.Options("patchlaw_")
    options["ksp_rtol"] = 0.1
    try:
        loose = tetrahedra()
    finally:
        options.delValue("ksp_rtol")
    found = tetrahedra()
    monkeypatch.setenv("PATCHLAW_CACHE", "off")
    np.testing.assert_array_equal(found, tetrahedra())
    assert np.abs(loose - found).max() > 1e-4 * found.max()  # so that it would show


def test_both_compliances_of_a_coarse_block():
    """The plain mesh is too stiff below a loaded patch, the half-space and its body are not.

    Measured relative to the largest entry: 6.4 % apart with 2 × 4 elements under a patch, 2.9 %
    with 4 × 8, 1 % with 8 × 16.
    """
    decomposed = exact_compliance([8, 8, 5])
    np.testing.assert_allclose(decomposed, decomposed.T, rtol=1e-12)
    apart = [
        np.abs(compliance(cells) - decomposed).max() / decomposed.max()
        for cells in ([8, 8, 5], [16, 16, 8])
    ]
    assert apart[0] < 0.07
    assert apart[1] < 0.5 * apart[0]


def test_leaving_a_law_ends_the_run_and_keeps_what_was_accepted():
    whole = Run(scene())
    whole.make_laws()
    short = Run(scene(approach="4 um")).make_laws()
    whole.coupling.table = short
    with pytest.raises(NotConverged, match=r"load step 2 .approach 0.0053.*LAW_RANGE: patch \("):
        list(whole.load_steps())
    assert [step.step for step in whole.steps] == [1]


@pytest.mark.long
def test_fields_are_those_of_the_patch_pressures(monkeypatch):
    """Without a mesh that was pressed, one is loaded by the pressures that were found."""
    written, fields = [], []
    write = "patchlaw.macro.fields.write_fields"
    monkeypatch.setattr(write, lambda path, *what: written.append(what))
    for condensed in (True, False):
        lay_on_mesh(monkeypatch, condensed=condensed)
        whole = Run(scene("output.fields=true"))
        list(whole.load_steps())
        whole.observers.fields.write(Path("fields.xdmf"), whole.steps, finished=whole.finished)
        interface, steps = written.pop()
        ((number, displacement, pressure, *_),) = steps
        assert number == len(whole.steps)
        np.testing.assert_array_equal(pressure, whole.steps[-1].patches.pressure_MPa)
        fields.append(displacement)
        assert interface.body.owned_dofs == displacement.size
    # linear solves to 1e-10 of the load
    np.testing.assert_allclose(fields[1], fields[0], atol=1e-8 * np.abs(fields[0]).max())


@pytest.mark.parametrize(("overrides", "condensed"), [
    ([], True), (["block.element=P1"], True), (["block.element=P1", *MANY], False), (MANY, True),
    (["coupling.interface=pointwise"], False),
    (["friction.coefficient=0.3", "load.shear=[0.001, 0]"], False),
])  # fmt: skip
def test_laws_are_condensed_unless_the_mesh_is_needed(overrides, condensed):
    """Where more happens than mean pressures, or more patches than laws have rows want a mesh."""
    assert make_setup(scene(*overrides)).condensed == condensed


def test_cells_of_a_decomposed_block_do_not_matter():
    """Its body term has a mesh of its own."""
    coarse, fine = (exact_compliance(cells) for cells in ([8, 8, 5], [64, 64, 40]))
    np.testing.assert_array_equal(coarse, fine)
    text = dict(make_setup(scene("coupling.kind=consistent")).about.statements())["block"]
    assert "from finite elements of high order" in text


def test_a_patch_whose_gap_hardly_closes_counts_by_its_pressure():
    """Near full contact −dp/dū is large, of either sign; the force over the mean gap is not."""
    own, rates = np.array([1e15, 200.0, 0.0]), np.array([40.0, 50.0, 0.0])
    for barely in (-1e-7, 0.0, 1e-9):
        closed = np.array([barely, 0.25, 1.0])
        found = whole_stiffness(own, closed, rates)
        assert found == pytest.approx(90.0 / closed.mean(), rel=1e-12)
    # −1 to 1e-4: it opens, or closes by the rounding or the interpolation of laws, in full contact
    for noise in (-1.0, 0.0, 3.1e-17, 9.7e-5):
        assert np.isnan(whole_stiffness(own, np.full(3, noise), rates))
