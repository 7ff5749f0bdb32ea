"""Contacts and fields read back from a folder are those of the run; what is damaged is refused."""

import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Run, Scene, read_contact, read_fields
from patchlaw.multiscale.results.contacts import FIELDS
from patchlaw.multiscale.runs.output.results import write_fields, write_results
from patchlaw.support import InputError

CYCLE = ("load.force=['1.5 N', '0 N']", "micro.hardness=80 MPa", "output.contact=all")


def results(folder, *words):
    """Return a finished run whose results are in a folder."""
    path = folder / "scene.toml"
    text = SMALL_SCENE if "load.force" not in "".join(words) else SMALL_SCENE.replace(
        'approach = "8 um"', 'force = "1 N"'
    )  # fmt: skip
    path.write_text(text)
    run = Run(Scene.load(path, list(words)))
    list(run.load_steps())
    run.finish()
    write_results(folder / "out", run, options=[])
    return run


@pytest.fixture(scope="module")
def cycle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cycle")
    return results(folder, *CYCLE), folder / "out"


@pytest.fixture
def copied(cycle, tmp_path):
    """Return the folder of the cycle's results, for a test to damage."""
    for path in cycle[1].iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def test_contacts_are_those_of_the_run(cycle):
    run, folder = cycle
    found = read_contact(folder)
    assert len(found) == 4 and found.step.tolist() == [1, 2, 3, 4]
    for one, other in zip(found, run.contacts, strict=True):
        for name in (*FIELDS, "spots"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        for name in ("step", "approach_mm", "force_N", "lengths_mm", "unloading"):
            assert getattr(one, name) == getattr(other, name)


def test_arrays_have_the_load_steps_as_first_axis(cycle):
    found, history = read_contact(str(cycle[1])), cycle[0].history()
    assert found.pressure_MPa.shape == found.gap_mm.shape == (4, 16, 16)
    assert found.x_mm.shape == found.y_mm.shape == (16,)
    cell = found.x_mm[1] - found.x_mm[0]
    # cells are equal squares: their pressures add up to the force of the load step
    np.testing.assert_allclose(
        cell**2 * found.pressure_MPa.sum(axis=(1, 2)), history.force_N, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_array_equal(found.unloading, [False, False, True, True])
    np.testing.assert_array_equal(found.plastic_depth_mm.max(axis=(1, 2)), history.plastic_depth_mm)
    assert (np.diff(found.plastic_depth_mm, axis=0) >= 0.0).all()  # it never heals
    assert found.plastic_depth_mm[-1].max() > 0.0
    assert [len(spots) for spots in found.spots] == history.contacts.tolist()
    assert found.at(2) is found[1]
    with pytest.raises(InputError, match=r"step = 7: .*\(allowed: 1, 2, 3, 4; any of a run with"):
        found.at(7)


def test_steps_fall_where_force_or_else_approach_does(cycle):
    last = cycle[0].history().steps[-1]
    assert not last.is_unloading(None)
    assert not last.is_unloading(replace(last, force_N=-0.0))
    assert replace(last, approach_mm=last.approach_mm - 1e-5).is_unloading(last)
    more = replace(last, force_N=1.0, approach_mm=last.approach_mm - 1e-5)
    assert last.is_unloading(more) and not more.is_unloading(last)


def test_a_force_that_falls_by_wear_is_no_unloading(cycle):
    last = cycle[0].history().steps[-1]
    before = replace(last, force_N=1.0, slid_mm=0.0)
    assert not replace(last, force_N=0.7, slid_mm=3.0).is_unloading(before)
    lifted = replace(last, force_N=0.7, slid_mm=3.0)
    assert replace(lifted, force_N=0.2).is_unloading(lifted)  # nothing slides to it


def test_spots_without_maps(tmp_path):
    results(tmp_path, "micro.model=elliptic", "output.contact=all")
    found = read_contact(tmp_path / "out")
    assert [len(spots) > 0 for spots in found.spots] == [True, True]
    with pytest.raises(InputError, match=r"pressure_MPa: is not known .*a model with cells"):
        _ = found.pressure_MPa
    titles = [axes.get_title() for axes in found.plot(2).axes]
    assert titles[0] == "spots, as circles of their areas"


def test_depths_are_those_of_a_hardness_alone(tmp_path):
    results(tmp_path)
    with pytest.raises(InputError, match=r"plastic_depth_mm: .*\(allowed: with a hardness\)"):
        _ = read_contact(tmp_path / "out").plastic_depth_mm


def test_datasets_have_named_dimensions(cycle, monkeypatch):
    class Dataset:
        def __init__(self, values, coords, attrs):
            self.sizes, self.values, self.attrs = {}, values, attrs
            for name, (dimensions, array) in {**values, **coords, "step": (
                ("step",), coords["step"])}.items():  # fmt: skip
                for dimension, size in zip(dimensions, np.shape(array), strict=True):
                    assert self.sizes.setdefault(dimension, size) == size, name

    xarray = ModuleType("xarray")
    xarray.Dataset = Dataset
    monkeypatch.setitem(sys.modules, "xarray", xarray)
    found = read_contact(cycle[1])
    made = found.to_xarray()
    count = sum(len(spots) for spots in found.spots)
    assert made.sizes == {"step": 4, "x": 16, "y": 16, "spot": count}
    assert {"pressure_MPa", "gap_mm", "plastic_depth_mm", "spot_force_N"} <= set(made.values)


def test_datasets_are_those_of_xarray(cycle):
    pytest.importorskip("xarray")
    made, found = read_contact(cycle[1]).to_xarray(), read_contact(cycle[1])
    np.testing.assert_array_equal(made["gap_mm"].sel(step=3), found.at(3).gap_mm)
    np.testing.assert_array_equal(
        made["spot_area_mm2"][made["spot_step"] == 2], found.at(2).area_mm2
    )


def test_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere/history\.csv: cannot be read: No such file"):
        read_contact(tmp_path / "nowhere")


def test_table_of_spots_that_is_missing_is_named(copied):
    (copied / "contacts.csv").unlink()
    with pytest.raises(InputError, match=r"contacts\.csv: cannot be read"):
        read_contact(copied)


@pytest.mark.parametrize("damage", [lambda all: all[: len(all) // 2], lambda all: all[:-1] + b"?"])
def test_maps_that_are_damaged_are_refused(copied, damage):
    path = copied / "contact.h5"
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InputError, match=r"contact\.h5: "):
        read_contact(copied)


def test_maps_of_another_run_are_refused(copied, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    results(other)
    (copied / "contact.h5").write_bytes((other / "out" / "contact.h5").read_bytes())
    with pytest.raises(InputError, match=r"contact\.h5: has no maps of these contacts"):
        read_contact(copied)


def test_run_without_contacts_has_none(tmp_path):
    results(tmp_path, "output.contact=none")
    with pytest.raises(InputError, match=r"out: has no contacts: .*output\.contact = 'last'"):
        read_contact(tmp_path / "out")


@pytest.fixture(scope="module")
def fields(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    words = ["coupling.kind=concurrent", "output.fields=all", "block.cells=[6, 6, 4]"]
    run = results(folder, *words)
    write_fields(folder / "out", run)
    return run, folder / "out"


def test_fields_are_those_of_the_body(fields):
    run, folder = fields
    found = read_fields(folder)
    assert found.step.tolist() == [1, 2]
    assert found.cells.shape == (6 * 6 * 4, 8) and found.cell_type == "Hexahedron"
    assert found.points_mm.shape == (7 * 7 * 5, 3)
    stress = found.stress_MPa - np.eye(3) * np.trace(
        found.stress_MPa, axis1=2, axis2=3
    )[..., None, None] / 3.0  # fmt: skip
    equivalent = np.sqrt(1.5 * (stress**2).sum(axis=(2, 3)))
    np.testing.assert_allclose(found.von_mises_MPa, equivalent, rtol=1e-9)
    middle = found.points_mm[found.cells].mean(axis=1)
    top = middle[:, 2] > middle[:, 2].max() - 0.1
    assert np.all(found.pressure_MPa[:, ~top] == 0.0)
    # pressures of the facets of equal cells add up to the force
    force = found.pressure_MPa.sum(axis=1) / 36.0
    np.testing.assert_allclose(force, run.history().force_N, rtol=1e-8)
    bottom = found.points_mm[:, 2] == found.points_mm[:, 2].min()
    assert np.abs(found.displacement_mm[:, bottom]).max() < 1e-15  # clamped, to rounding
    assert np.abs(found.displacement_mm[:, ~bottom]).max() > 1e-4


def test_fields_that_are_cut_short_are_refused(fields, tmp_path):
    content = (fields[1] / "fields.h5").read_bytes()
    (tmp_path / "fields.h5").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"fields\.h5: cannot be read"):
        read_fields(tmp_path)


def test_run_without_fields_has_none(cycle):
    with pytest.raises(InputError, match=r"fields\.h5: there are no fields .*output\.fields"):
        read_fields(cycle[1])
    with pytest.raises(InputError, match=r"counter_fields\.h5: there are no fields"):
        read_fields(cycle[1], counter=True)
