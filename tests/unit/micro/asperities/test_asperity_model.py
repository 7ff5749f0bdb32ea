"""The four models: names, single contacts, states, curves, refusals."""

import numpy as np
import pytest
from helpers.along import respond
from helpers.asperity_states import displacement, interference, pressed

from patchlaw import InputError
from patchlaw.geometry import Control, PatchGrid, Surface
from patchlaw.micro import MODELS, AsperityModel, HertzContact, micro_model

E_STAR = 4000.0
ONE_PATCH = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
PATCHES = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
every_model = pytest.mark.parametrize("name", MODELS)


def curve(model, approaches, patches=PATCHES, **options):
    heights = np.full(patches.count, model.asperities.mean_height)
    return respond(model, approaches, patches=patches, mean_heights=heights, **options)


@every_model
def test_single_asperity_is_hertz(summits, name):
    one = summits(0.3, 0.7, z=-1e-3, major=0.4, minor=0.1, highest=0.0)
    model = AsperityModel(name, one, contact_modulus=E_STAR)
    state = pressed(model, 5e-3)
    radii = (0.4, 0.1) if name.startswith("elliptic") else (0.2, 0.2)
    hertz = HertzContact(
        contact_modulus=E_STAR, radius_major=radii[0], radius_minor=radii[1], indentation=4e-3
    )
    assert interference(one, state) == pytest.approx([4e-3])
    assert displacement(model, state) == pytest.approx([4e-3])
    assert state.ellipses.force == pytest.approx([hertz.force])
    assert state.ellipses.area == pytest.approx([hertz.area])
    axes = np.array([[hertz.semi_major, hertz.semi_minor]])
    assert state.ellipses.semi_axes == pytest.approx(axes)


@pytest.mark.parametrize("name", ["elliptic-independent", "circular-independent"])
def test_independent_models_are_sums(cluster, name):
    state = pressed(AsperityModel(name, cluster, contact_modulus=E_STAR), 3e-3)
    assert state.indentation == pytest.approx(np.maximum(3e-3 + cluster.z, 0.0))
    assert state.iterations == 0 and state.residual == 0.0


@every_model
@pytest.mark.parametrize("approach", [0.0, -1e-3])
def test_before_touch(cluster, name, approach):
    model = AsperityModel(name, cluster, contact_modulus=E_STAR)
    state = pressed(model, approach)
    assert not state.ellipses.force.any() and not displacement(model, state).any()
    response = curve(model, [approach])
    assert response.force == [0.0] and response.contacts == [0] and not response.patch_force.any()
    assert response.mean_separation == pytest.approx([0.02 - approach])


@every_model
def test_no_asperities(summits, name):
    none = summits([], [], highest=0.0)
    model = AsperityModel(name, none, contact_modulus=E_STAR)
    assert len(pressed(model, 1e-3).ellipses.force) == 0
    assert curve(model, [1e-3, 2e-3]).force.tolist() == [0.0, 0.0]


def test_without_patches_the_whole_surface_is_one(cluster):
    model = AsperityModel("elliptic", cluster, contact_modulus=E_STAR)
    alone, given = respond(model, [4e-3]), curve(model, [4e-3], ONE_PATCH)
    assert alone.patch_force[0] == alone.force == given.force
    assert alone.mean_separation == given.mean_separation
    forced = model.press(Control(force=float(alone.force[0])))
    assert forced.approach == pytest.approx(4e-3, rel=1e-8)  # forces are met to 1e-9
    message = r"asperities do not know the mean heights of patches \(allowed: mean_heights, or no"
    with pytest.raises(InputError, match=message):
        respond(model, [4e-3], patches=PATCHES)


@every_model
def test_tilt(cluster, name):
    model = AsperityModel(name, cluster, contact_modulus=E_STAR)
    tilt = (5e-3, -8e-3)
    state = pressed(model, 3e-3, tilt=tilt)
    # The same as asperities of other heights under a level plane.
    raise_by = tilt[0] * (cluster.x - 0.5) + tilt[1] * (cluster.y - 0.5)
    arrays = {key: getattr(cluster, key) for key in ("x", "y", "radius_major", "radius_minor")}
    turned = type(cluster)(
        **arrays,
        angle=cluster.angle,
        z=cluster.z + raise_by,
        lengths=(1.0, 1.0),
        highest=0.0,
        mean_height=-0.02,
    )
    level = pressed(AsperityModel(name, turned, contact_modulus=E_STAR), 3e-3)
    assert state.ellipses.force == pytest.approx(level.ellipses.force, rel=1e-9)
    response = curve(model, [3e-3], tilt=tilt)
    assert response.force[0] == pytest.approx(state.ellipses.force.sum(), rel=1e-9)
    # The plane's mean approach is that of its centre, patch by patch that of the patch's centre.
    local = 3e-3 + (PATCHES.centres - 0.5) @ np.array(tilt)
    gap = 0.02 - local + response.patch_displacement[0]
    assert response.patch_separation[0] == pytest.approx(gap)
    assert response.mean_separation[0] == pytest.approx(gap.mean())


def test_refuses(cluster):
    with pytest.raises(
        InputError, match=r"'flat': this micro model is unknown.*elliptic, circular"
    ):
        AsperityModel("flat", cluster, contact_modulus=1.0)
    with pytest.raises(InputError, match=r"-1\.0: the contact modulus must be positive"):
        AsperityModel("circular", cluster, contact_modulus=-1.0)
    model = AsperityModel("elliptic", cluster, contact_modulus=1.0)
    corner = PatchGrid(grid=(1, 1), lengths=(0.5, 0.5))
    with pytest.raises(InputError, match="points lie outside the patches"):
        respond(model, [1e-3], patches=corner, mean_heights=[0.0])


def test_unknown_model_by_name():
    surface = Surface(heights=np.eye(8), lengths=(1.0, 1.0))
    with pytest.raises(InputError, match=r"'flat': unknown micro model \(allowed: .*half-space"):
        micro_model("flat", surface, contact_modulus=1.0)
