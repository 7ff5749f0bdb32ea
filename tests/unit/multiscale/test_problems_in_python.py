"""A problem that a program composes gives the numbers of the scene that says the same."""

import numpy as np
import pytest

from patchlaw import (
    CellContact,
    Control,
    ElasticBlock,
    InputError,
    LoadHistory,
    Material,
    NotConverged,
    PatchContact,
    PatchGrid,
    Problem,
    Scene,
    Spectrum,
    run,
    synthesise,
)
from patchlaw.multiscale import Run

SPECTRUM = {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.1, "seed": 11}
RUBBER = Material(young_modulus=4000.0, poisson_ratio=0.2)
SIDES = 1.0, 0.8


def surface(**changes):
    asked = SPECTRUM | changes
    spectrum = Spectrum(**{key: tuple(v) if key == "waves" else v for key, v in asked.items()})
    return synthesise(spectrum, grid=(32, 24), lengths=SIDES)


def scene(kind, load, **sections):
    """Return the scene of the same surface on a block."""
    data = {
        "surface": {"spectrum": SPECTRUM, "grid": [32, 24], "lengths": list(SIDES)},
        "block": {"height": 0.7, "young_modulus": 4000.0, "poisson_ratio": 0.2},
        "coupling": {"kind": kind},
        "load": load,
        "output": {"check": "none"},
    }
    return Scene.from_dict(data | sections)


def forces(steps):
    return np.array([[one.approach_mm, one.force_N, one.contact_area_fraction] for one in steps])


@pytest.mark.parametrize(("kind", "body", "path"), [
    ("concurrent", ElasticBlock(RUBBER, height=0.7), {"force": [3.0, 1.0], "steps": 2}),
    ("analytic", RUBBER, {"approach": [0.004], "steps": 2, "tilt": "free"}),
])  # fmt: skip
def test_cells_in_contact_are_those_of_a_scene(kind, body, path):
    loads = {key: tuple(v) if isinstance(v, list) else v for key, v in path.items()}
    steps = Problem(CellContact.of(surface(), body), LoadHistory(**loads)).steps()
    wanted = run(scene(kind, path)).steps
    # a run keeps matrices of few cells, whose solutions differ within the tolerance
    np.testing.assert_allclose(forces(steps), forces(wanted), rtol=1e-8)


@pytest.mark.long
def test_friction_and_hardness_are_those_of_a_scene():
    path = {"force": [3.0], "steps": 1, "shear": [[1e-4, 0.0]], "shear_steps": 2}
    wanted = run(scene(
        "concurrent", path, micro={"hardness": 300.0},
        friction={"coefficient": 0.3, "coupled": False},
    )).steps  # fmt: skip
    model = CellContact.of(
        surface(), ElasticBlock(RUBBER, height=0.7), hardness=300.0, friction=0.3
    )
    loads = LoadHistory(force=(3.0,), steps=1, shear=((1e-4, 0.0),), shear_steps=2)
    steps = list(Problem(model, loads).steps())
    assert 0.0 < steps[-1].slip_area_fraction < steps[-1].contact_area_fraction
    for one, other in zip(steps, wanted, strict=True):
        assert one.force_N == pytest.approx(other.force_N, rel=1e-8)
        assert one.plastic_depth_mm == pytest.approx(other.plastic_depth_mm, rel=1e-8)
        if other.shear_x_mm:
            assert one.shear_force_x_N == pytest.approx(other.shear_force_x_N, rel=1e-6)


def test_patches_with_laws_are_those_of_a_scene():
    path = {"force": [3.0], "steps": 2}
    whole = Run(scene("consistent", path, patches={"grid": [2, 2]}))
    wanted, laws = list(whole.load_steps()), whole.laws
    whole.close()
    compliance = ElasticBlock(RUBBER, height=0.7).compliance(PatchGrid(grid=(2, 2), lengths=SIDES))
    steps = Problem(PatchContact(laws, compliance), LoadHistory(force=(3.0,), steps=2)).steps()
    np.testing.assert_allclose(forces(steps), forces(wanted), rtol=1e-9)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: ElasticBlock(RUBBER, height=-1.0), "height"),
    (lambda: ElasticBlock(RUBBER, height=1.0, sides="glued"), "sides"),
    (lambda: CellContact.of(surface(), "steel"), "body"),
    (lambda: CellContact.of(surface(), ElasticBlock(RUBBER, height=0.7), periodic=True),
     "body: does not continue periodically"),
    (lambda: CellContact.of(surface(), RUBBER, friction=-0.3), "friction"),
    (lambda: CellContact.of(surface(rms_slope=1.2), RUBBER), "0.8"),
])  # fmt: skip
def test_what_does_not_fit_is_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_a_load_step_that_is_refused_leaves_nothing_behind():
    def contact(held):
        made = CellContact.of(surface(), RUBBER, wear=1e-7)
        made.held = held
        return made

    # the highest summit lies inside, and contacts of the deep plane reach the side
    tried, alone = contact([(0.0, SIDES[1])]), contact([])
    with pytest.raises(NotConverged, match="SUPPORT_IN_CONTACT"):
        tried.press(Control(approach=0.01, slid=20.0))
    control = Control(approach=0.001, slid=10.0)
    steps = [one.press(control) for one in (tried, alone)]
    assert steps[0].worn_volume_mm3 == steps[1].worn_volume_mm3 > 0.0
    assert steps[0].slid_mm == 10.0
