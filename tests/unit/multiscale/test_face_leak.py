"""The leak over a contact face between two edges, under laws of samples; and its refusals."""

import csv
import warnings
from dataclasses import replace

import h5py
import numpy as np
import pytest
from helpers.box_msh import write_box

from patchlaw.geometry import Control
from patchlaw.micro.transport import gap_flow, widened_gap
from patchlaw.micro.wear import slide
from patchlaw.multiscale import Run, Scene, read_fields, read_history
from patchlaw.multiscale.laws.export import export_texts
from patchlaw.multiscale.laws.transmissivity import _scatter, error_of_grid, sample_transmissivity
from patchlaw.multiscale.observers.leak import FluidMap
from patchlaw.multiscale.results.figures.observed import leak_figure
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.support import InputError

OIL = {"viscosity": "10 mPa s", "pressures": ["5 bar", "1 bar"], "inlet": "left", "outlet": "right"}
SUPPORTS = [
    {"surface": "bottom", "displacement": ["free", "free", "0"]},
    {"surface": "left", "displacement": ["0", "free", "free"]},
    {"surface": "front", "displacement": ["free", "0", "free"]},
]
"""Rollers on three sides, on which a level plane presses a box evenly."""


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("box") / "box.msh"
    write_box(path, [np.linspace(0, 6, 7), np.linspace(0, 4, 5), np.linspace(0, 2, 3)])
    return path


def scene(box, leak=OIL, **changes):
    spectrum = {"hurst": 0.8, "waves": [2, 8], "rms_height": "1 um", "seed": 2}
    body = {"mesh": str(box), "contact": "top", "supports": SUPPORTS}
    data = {
        "surface": {"spectrum": spectrum, "grid": [32, 32], "lengths": ["0.5 mm", "0.5 mm"]},
        "body": body | {"young_modulus": "4 GPa", "poisson_ratio": 0.3},
        "law": {"kind": "representative"},
        "load": {"force": "600 N", "steps": 2},
        "leak": leak,
        "output": {"figures": True, "report": True, "check": "all"},
    }
    return Scene.from_dict({**data, **changes})


@pytest.fixture(scope="module")
def laws(box):
    """The laws of the sample, which all its runs have in common."""
    done = Run(scene(box))
    table = done.make_laws()
    done.close()
    return table


def begun(given, laws):
    """Return a run with laws that are at hand."""
    done = Run(given)
    done.coupling.table = laws
    return done


def gaps(model, separation):
    """Return the gaps of a periodic sample at a mean separation."""
    reference = model.reference_height - model.surface.mean_height
    return model.press(Control(approach=reference - separation)).open_gap


@pytest.mark.slow
@pytest.mark.parametrize(("edges", "axis"), [(("left", "right"), 0), (("back", "front"), 1)])
def test_an_evenly_pressed_box_leaks_as_its_sample(box, laws, edges, axis, tmp_path):
    leak, drawn = OIL | {"inlet": edges[0], "outlet": edges[1]}, axis == 0
    output = {"figures": drawn, "report": drawn, "check": "all"}
    done = begun(scene(box, leak, output=output), laws)
    steps = list(done.load_steps())
    ((model,),) = done.coupling.periodic_models
    along, across = ((6.0, 4.0), (4.0, 6.0))[axis]
    for step in steps:
        gap = gaps(model, step.mean_separation_mm)
        flow = gap_flow(gap, (0.5, 0.5), axis=axis, periodic=True)
        expected = flow.transmissivity * across / along * 0.4 / (12.0 * 1e-8)
        # monotone interpolation between rows, whose error is stated
        leak = step.leak("face")
        causes = dict(leak.causes)
        assert list(causes) == ["mesh", "grid", "rows"] and leak.error == sum(causes.values())
        assert leak.rate == pytest.approx(expected, rel=0.05)  # next to closing, see below
        assert abs(leak.rate - expected) <= causes["rows"] + 1e-6 * expected
        assert causes["mesh"] < 1e-6 * expected  # the separation is the same everywhere
        half, quarter = (
            gap_flow(gaps(model.resampled(grid), step.mean_separation_mm), (0.5, 0.5), axis=axis,
                     periodic=True).transmissivity
            for grid in ((16, 16), (8, 8))
        )  # fmt: skip
        wide = gap_flow(widened_gap(gap, periodic=True), (0.5, 0.5), axis=axis, periodic=True)
        flows = flow.transmissivity, half, quarter, wide.transmissivity
        error = expected / flow.transmissivity * error_of_grid(*flows)
        # it changes as steeply as T between rows next to closing, which are as near as it asks for
        assert causes["grid"] == pytest.approx(error, rel=0.5)
        assert abs(leak.rate - expected) < 0.25 * error
        assert step.leak("x") is None
    assert steps[0].leak("face").rate > steps[1].leak("face").rate > 0.0
    write_results(tmp_path, done, options=[])
    if drawn:
        assert (tmp_path / "leak.png").stat().st_size > 5_000
        report = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "leak over the contact face" in report
    again = read_history(tmp_path)
    for name in ("leak_mm3_per_s", "leak_error_mm3_per_s"):
        np.testing.assert_array_equal(getattr(again, name), getattr(done.history(), name))
    (said,) = (n for n in done.history().notes if "leak over the contact face at load step 2" in n)
    assert "what other samples than the one of top would change is not known" in said
    done.close()


@pytest.mark.long
def test_transmissivity_grows_as_the_separation_where_nothing_touches(box, laws):
    done = begun(scene(box), laws)
    ((model,),) = done.coupling.periodic_models
    (law,) = laws.laws
    flow = law.transmissivity
    touch = flow.separation[-1]
    np.testing.assert_allclose(
        np.cbrt(flow.at(np.array([touch + 1.0]))) - 1.0, flow.hydraulic_gap[-1:]
    )
    closed = sample_transmissivity([model], np.zeros_like)
    assert (closed.at(np.array([0.0])) == 0.0).all() and (flow.scatter == 0.0).all()
    # rows end where a law does
    part = sample_transmissivity([model], np.zeros_like, least=0.5 * touch)
    assert part.separation[[0, -1]] == pytest.approx([0.49 * touch, touch])
    places = np.linspace(0.5, 1.0, 20) * touch
    stated = part.varied("rows", places) + closed.varied("rows", places) - closed.at(places)
    assert (np.abs(part.at(places) - closed.at(places)) <= stated - part.at(places)).all()
    assert (np.diff(flow.hydraulic_gap, axis=0) >= 0.0).all()
    # in contact, at a row, and between it and the next one
    separation = np.array([flow.separation[-6], np.mean(flow.separation[-6:-4])])
    own, half, quarter = (
        np.array([
            [
                gap_flow(gaps(one, at), (0.5, 0.5), axis=axis, periodic=True).transmissivity
                for axis in (0, 1)
            ]
            for at in separation.tolist()
        ])
        for one in (model, model.resampled((16, 16)), model.resampled((8, 8)))
    )  # fmt: skip
    between = np.abs(flow.varied("rows", separation) - flow.at(separation))[1]
    assert (np.abs(flow.at(separation)[1] - own[1]) <= between).all()
    assert (between < 0.3 * own[1]).all()
    expected = own[0] + error_of_grid(own[0], half[0], quarter[0])
    np.testing.assert_allclose(flow.varied("grid", separation)[0], expected, rtol=1e-3)
    closure = law.initial_separation - separation
    np.testing.assert_allclose(law.transmissivities(closure), flow.at(separation), rtol=1e-9)
    rows = list(csv.DictReader(export_texts(done.laws, "csv", 1e-3)["laws.csv"].splitlines()))
    found = np.array([float(row["transmissivity_y_mm3"]) for row in rows])
    at = np.array([float(row["separation_mm"]) for row in rows])
    np.testing.assert_allclose(found, flow.at(at)[:, 1], rtol=1e-12)
    done.close()


@pytest.mark.parametrize(("leak", "text"), [
    (OIL | {"inlet": "lefd"}, r"leak\.inlet = 'lefd'.*did you mean 'left'"),
    (OIL | {"outlet": "bottom"}, "leak: the outlet has no edge in common with the contact"),
    (OIL | {"outlet": "front"}, "leak: inlet and outlet touch each other"),
    (OIL | {"outlet": "left"}, r"leak\.outlet = 'left': is the inlet"),
    (OIL | {"direction": "x"}, "leak: 'direction' does not go with edges"),
    ({key: OIL[key] for key in ("viscosity", "pressures", "inlet")}, r"leak\.outlet: is missing"),
    ({key: OIL[key] for key in ("viscosity", "pressures")}, r"leak\.inlet: is required with law"),
])  # fmt: skip
def test_bad_edges(box, leak, text):
    with pytest.raises(InputError, match=text):
        Run(scene(box, leak))


@pytest.mark.long
def test_two_bodies_leak_as_their_sample(box):
    """Evenly pressed: one separation everywhere; the counter-body is the same box upside down."""
    above = {"mesh": str(box), "contact": "bottom", "young_modulus": "8 GPa", "poisson_ratio": 0.3}
    supports = [one | {"surface": "top"} if one["surface"] == "bottom" else one for one in SUPPORTS]
    output = {"figures": False, "report": False}
    pair = scene(box, counter_body=above | {"supports": supports}, output=output)
    done = Run(pair)
    *_, step = done.load_steps()
    ((model,),) = done.coupling.periodic_models
    gap = gaps(model, step.mean_separation_mm)
    expected = gap_flow(gap, (0.5, 0.5), periodic=True).transmissivity * 4.0 / 6.0 * 0.4 / 12e-8
    assert step.leak("face").rate == pytest.approx(expected, rel=2e-3)
    done.close()


def test_bodies_whose_faces_do_not_meet_are_refused(box, tmp_path):
    small = tmp_path / "small.msh"
    write_box(small, [np.linspace(0, 2, 3), np.linspace(0, 4, 5), np.linspace(0, 2, 3)])
    above = {"mesh": str(small), "contact": "bottom", "supports": [{"surface": "top"}]}
    above |= {"young_modulus": "8 GPa", "poisson_ratio": 0.3}
    with pytest.raises(InputError, match="leak: a part of the contact face has no laws, or no fac"):
        Run(scene(box, counter_body=above))


@pytest.mark.long
def test_the_scatter_of_samples_is_that_at_equal_pressures(box):
    """Of the hydraulic gaps of two samples under the pressure itself, the difference over √2.

    Its mean square along x and y counts.
    """
    done = Run(scene(box))
    ((model,),) = done.coupling.periodic_models
    done.close()
    turned = replace(model.surface, heights=1.1 * model.surface.heights.T)
    models = [model, replace(model, surface=turned)]
    models = [one.resampled((16, 16)) for one in models]
    reference = models[1].reference_height - turned.mean_height
    law = np.linspace(0.1, 1.0, 20) * reference, np.linspace(30.0, 0.0, 20)
    flow = sample_transmissivity(models, lambda separation: np.interp(separation, *law))
    for row in (-6, -10):
        pressure = float(np.interp(flow.separation[row], *law))
        each = []
        for one in models:
            gap = one.press(Control(force=pressure * one.surface.area)).open_gap
            flows = (gap_flow(gap, (0.5, 0.5), axis=k, periodic=True) for k in (0, 1))
            each.append([one.hydraulic_gap for one in flows])
        apart = np.sqrt(np.mean(np.subtract(*each) ** 2) / 2.0)
        at = flow.separation[[row]]
        for times in (1.0, 2.0):
            wider = (np.cbrt(flow.at(at)[0]) + times * apart) ** 3
            np.testing.assert_allclose(flow.varied("samples", at, times)[0], wider, rtol=0.02)


def test_samples_that_close_at_other_pressures_scatter_beyond_closing():
    """Of hydraulic gaps s (p_c − p) it is s times the difference of p_c over √2, everywhere."""
    slope, ends = 2e-5, np.array([30.0, 41.0])
    pressure = np.array([0.0, 10.0, 20.0, 30.0, 41.0, 60.0])
    gaps = np.maximum(slope * (ends[:, None] - pressure), 0.0)
    rows = np.zeros((2, len(pressure), 3))
    rows[..., :2], rows[..., 2] = gaps[..., None] ** 3, pressure
    rows[0, 4:, 2] = rows[1, 5:, 2] = np.nan  # beyond the first closed row nothing is solved
    apart = _scatter(rows, np.full(2, 0.5), pressure)
    np.testing.assert_allclose(apart, slope * 11.0 / np.sqrt(2.0), rtol=1e-12)
    closed = rows * [0.0, 0.0, 1.0]  # of what is never open no line is known
    assert not _scatter(closed, np.full(2, 0.5), pressure).any()


@pytest.mark.long
def test_the_fluid_pressure_is_written_with_the_fields(box, laws, tmp_path):
    output = {"figures": False, "report": False, "fields": "last"}
    done = begun(scene(box, output=output), laws)
    list(done.load_steps())
    done.observers.fields.write(tmp_path / "fields.xdmf", done.steps, finished=done.finished)
    text = (tmp_path / "fields.xdmf").read_text(encoding="utf-8")
    assert text.count('Name="fluid_pressure"') == 1
    with h5py.File(tmp_path / "fields.h5") as file:
        (values,) = file["Function/fluid_pressure"].values()
        pressure, points = values[:, 0], file["Mesh/mesh/geometry"][:]
    on_face = np.isclose(points[:, 2], points[:, 2].max())
    expected = 0.5 - 0.4 * points[on_face, 0] / 6.0  # from 5 to 1 bar
    np.testing.assert_allclose(pressure[on_face], expected, atol=1e-9)
    read = read_fields(tmp_path)
    np.testing.assert_array_equal(read.fluid_pressure_MPa, [pressure])
    assert "fluid_pressure_MPa" in str(read)
    done.close()


@pytest.mark.slow
def test_a_lay_around_the_axis_of_a_part(box, laws):
    """Two directions of one law on a box: polar axes about a point far away are those of the face.

    Without a statement of law.axes the run warns where the directions differ by more than 2.
    """
    (law,) = laws.laws
    flow = law.transmissivity
    stretched = replace(flow, hydraulic_gap=flow.hydraulic_gap * [1.0, 2.0])
    laws = replace(laws, laws=(replace(law, transmissivity=stretched),))

    def leak(**axes):
        output = {"figures": False, "report": False, "check": "none"}
        law = {"kind": "representative", **axes}
        done = begun(scene(box, law=law, load={"force": "600 N"}, output=output), laws)
        *_, step = done.load_steps()
        along = stretched.at(np.array([step.mean_separation_mm]))[0]
        notes = list(map(str, done.history().notes))
        done.close()
        return step.leak("face").rate, notes, along

    own, notes, along = leak()
    (said,) = (note for note in notes if "law.axes" in note)
    assert "the transmissivity along y of samples is" in said
    stated, notes, _ = leak(axes="x")
    assert stated == own and not any("law.axes" in note for note in notes)
    far, *_ = leak(axes="polar", centre=["-10 m", "2 mm", "0 mm"])
    assert far == pytest.approx(own, rel=1e-4)
    across, *_ = leak(axes="polar", centre=["3 mm", "-10 m", "0 mm"])
    assert across / own == pytest.approx(along[1] / along[0], rel=1e-4)
    assert min(own, across) < leak(axes="polar")[0] < max(own, across)


@pytest.mark.long
def test_a_face_that_is_closed_in_part_is_drawn_and_told_in_words(box, laws):
    """Along x the sample is closed; the fluid has one pressure, of which there are no contours."""
    (law,) = laws.laws
    flow = law.transmissivity
    closed = replace(flow, hydraulic_gap=flow.hydraulic_gap * [0.0, 1.0])
    output = {"figures": False, "report": False, "check": "none"}
    done = begun(
        scene(box, load={"force": "600 N"}, output=output),
        replace(laws, laws=(replace(law, transmissivity=closed),)),
    )
    list(done.load_steps())
    history = done.history()
    (said,) = (str(note) for note in history.notes if "law.axes" in note)
    assert "fluid flows along y of samples alone, and lies along y of the face" in said
    section = done.scene.leak
    done.close()
    corners = np.array([[[0.0, 0.0], [6.0, 0.0], [0.0, 4.0]], [[6.0, 4.0], [0.0, 4.0], [6.0, 0.0]]])
    wet = np.array([[0.5] * 3, [np.nan] * 3])
    fluid = FluidMap(triangles=corners, pressure_MPa=wet, leaving_mm3_per_s=np.zeros(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        left = leak_figure(history, None, section, False, fluid).axes[0]
    assert len(left.collections) == 2  # contact and fluid


def test_edges_need_a_body_and_a_sample(box):
    block = {"young_modulus": "4 GPa", "poisson_ratio": 0.3}
    surface = {"spectrum": {"hurst": 0.8, "waves": [2, 8], "rms_slope": 0.1}, "grid": [48, 48]}
    data = {"surface": surface | {"lengths": [1.0, 1.0]}, "block": block, "leak": OIL}
    data |= {"coupling": {"kind": "concurrent"}, "load": {"force": 1.0}}
    with pytest.raises(InputError, match=r"leak\.inlet: needs law\.kind = 'representative' on a"):
        Scene.from_dict(data)


@pytest.mark.long  # laws and flows of worn samples: 10 s
def test_a_face_that_yields_and_wears_is_as_its_sample(box):
    """Pressed evenly: as the sample that yielded and slid alone under the same pressure."""
    spectrum = {"hurst": 0.8, "waves": [2, 4], "rms_height": "1 um", "seed": 2}
    surface = {"spectrum": spectrum, "grid": [24, 24], "lengths": ["0.5 mm", "0.5 mm"]}
    load, wear = {"force": "240 N", "steps": 1, "sliding": [1.5e2]}, {"coefficient": 3e-8}
    quiet = {"figures": False, "report": False, "check": "none"}
    hard = {"hardness": "60 MPa"}
    done = Run(scene(box, surface=surface, load=load, wear=wear, micro=hard, output=quiet))
    new, worn = done.load_steps()
    model = done.coupling.periodic_models[0][0]
    even = Control(force=10.0 * model.surface.area)  # 240 N on 6 mm × 4 mm
    state = model.press(even)
    for step, slid in ((new, 0.0), (worn, 1.5e2)):
        if slid:
            state = slide(model, even, state.start, 3e-8 * slid).state
        flow = gap_flow(state.open_gap, model.surface.lengths, axis=0, periodic=True)
        expected = flow.transmissivity * 4.0 / 6.0 * 0.4 / (12.0 * 1e-8)
        # hydraulic gaps and closures are linear in the logarithm of the depth, and between rows
        assert step.leaks[0].rate == pytest.approx(expected, rel=0.1)
        assert step.contact_area_fraction == pytest.approx(state.contact_area_fraction, rel=0.04)
        # the box, free at two sides, is 2 mm high
        approach = state.approach + 10.0 / 4e3 * 2.0
        assert step.approach_mm == pytest.approx(approach, abs=5e-3 * state.mean_separation)
        assert step.mean_separation_mm == pytest.approx(state.mean_separation, rel=0.01)
    assert state.plastic_depth.mean() > 0.02 * state.worn_depth.mean()
    assert worn.leaks[0].rate < 0.8 * new.leaks[0].rate
