"""Representative laws: their ends, the mean over samples, regions, and what they refuse."""

import csv
from dataclasses import replace
from io import BytesIO, StringIO

import numpy as np
import pytest
from helpers.along import respond

from patchlaw import InputError
from patchlaw.geometry import Control, Material, Regions, Spectrum, Surface, synthesise
from patchlaw.micro import FiniteSlopes, HalfSpaceModel
from patchlaw.multiscale import LawTable, read_laws, representative_law, representative_laws
from patchlaw.multiscale.laws.export import export_texts
from patchlaw.multiscale.laws.law_table import law_bytes
from patchlaw.multiscale.laws.of_samples import PeriodicSample

MODULUS = YOUNG = 4000.0


def sample(seed, slope=0.1):
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=slope, seed=seed)
    return synthesise(spectrum, grid=(18, 18), lengths=(1.0, 1.0))


SAMPLES = [sample(1), sample(2), sample(3, slope=0.07)]


@pytest.fixture(scope="module")
def law():
    return representative_law(SAMPLES, MODULUS, largest_pressure=60.0)


def direct(separation):
    """Return mean pressures and contacts of all samples at one separation, each one alone."""
    pressures, contacts = [], []
    for surface in SAMPLES:
        model = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=True)
        approach = model.reference_height - surface.mean_height - separation
        found = respond(model, [approach])
        pressures.append(found.mean_pressure[0])
        contacts.append(found.contacts[0])
    return np.array(pressures), np.array(contacts)


@pytest.mark.parametrize("row", [5, 17, -1])
def test_rows_are_means_at_equal_separation(law, row):
    rows = law.rows
    pressures, contacts = direct(law.initial_separation - rows.closure[row])
    largest = law.rows.pressure[-1]
    # the tolerance of the half-space model, 1e-8 of its interference
    assert rows.pressure[row] == pytest.approx(pressures.mean(), abs=1e-6 * largest)
    assert rows.pressure_scatter[row] == pytest.approx(pressures.std(ddof=1), abs=1e-6 * largest)
    assert law.pressure_scatter(rows.closure[row]) == rows.pressure_scatter[row]
    assert rows.contacts[row] == contacts.sum()


def test_the_law_keeps_its_tolerance_between_rows(law):
    closures = np.random.default_rng(2).uniform(*law.range, 40)
    pressures = np.array([direct(law.initial_separation - c)[0].mean() for c in closures])
    made = law.at(closures)
    load = np.maximum(pressures, 0.03 * law.rows.pressure[-1])
    # what is stated holds where a layer of the law's own compliance takes a part
    assert np.max(np.abs(made.pressure - pressures) / load) < 5e-3
    assert law.interpolation_error <= 3e-3
    assert made.separation == pytest.approx(law.initial_separation - closures, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_law_ends_as_stiff_as_one_that_goes_on_there(seed):
    """Near full contact closures stop little by little; a slope of 0 would be a rigid end."""
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.1, seed=seed)
    surface = synthesise(spectrum, grid=(24, 24), lengths=(1.0, 1.0))
    whole = representative_law([surface], 1.0, largest_pressure=10.0).rows
    end = float(np.interp(0.95, whole.contact_area_fraction, whole.pressure))
    law = representative_law([surface], 1.0, largest_pressure=end)
    longer = representative_law([surface], 1.0, largest_pressure=1.3 * end, tolerance=1e-4)
    at = law.range[1]
    # a one-sided slope at the end of 3 rows whose secants fall threefold; 10⁴ times as stiff before
    assert law.stiffness(at) == pytest.approx(longer.stiffness(at), rel=0.6)


def test_closure_counts_from_the_highest_sample(law):
    heights = [surface.highest - surface.mean_height for surface in SAMPLES]
    assert law.initial_separation == max(heights)
    # cells' centres are a little lower than the highest point
    assert 0.0 <= law.first_touch < 0.03 * max(heights)
    assert law.at(law.first_touch).pressure == 0.0
    assert law.sample_area == 3.0


def test_the_last_row_carries_the_largest_pressure(law):
    assert law.is_function
    assert 60.0 <= law.rows.pressure[-1] < 1.1 * 60.0
    with pytest.raises(InputError, match="closure beyond the end of the patch law"):
        law.at(1.01 * law.range[1])


@pytest.mark.long
def test_samples_count_by_their_areas():
    twice = np.tile(SAMPLES[1].heights, (2, 1))
    double = Surface(heights=twice, lengths=(2.0, 1.0), periodic=True)
    given = [[SAMPLES[0], double], [SAMPLES[0], SAMPLES[1], SAMPLES[1]]]
    one, other = (representative_law(each, MODULUS, largest_closure=0.01) for each in given)
    closures = np.linspace(*one.range, 50)
    assert one.pressure(closures) == pytest.approx(
        other.pressure(closures), abs=1e-6 * one.rows.pressure[-1]
    )
    assert one.sample_area == other.sample_area == 3.0


@pytest.mark.long
def test_one_sample_has_no_scatter_and_a_mean_law_less_than_its_samples():
    single = representative_law(SAMPLES[:1], MODULUS, largest_closure=0.01)
    assert not single.rows.pressure_scatter.any()
    same = representative_law([SAMPLES[0]] * 2, MODULUS, largest_closure=0.01)
    assert same.rows.pressure.tobytes() == single.rows.pressure.tobytes()
    assert np.max(same.rows.pressure_scatter) < 1e-12


@pytest.mark.parametrize(
    ("limits", "end"),
    [
        pytest.param({"largest_closure": 0.004}, 0.004, marks=pytest.mark.long),
        ({"largest_closure": 0.004, "largest_pressure": 1e4}, 0.004),
        ({"largest_closure": 0.05}, 0.05),
    ],
    ids=["closure", "closure first", "beyond full contact"],
)
def test_closure_ends_the_law(limits, end):
    law = representative_law(SAMPLES[:1], MODULUS, **limits)
    assert law.range[1] == pytest.approx(end, rel=1e-12)


def flattening(model):
    """Return the mean pressure that just flattens small slopes, from a larger one [MPa]."""
    pressures = replace(model, slopes=()).press(Control(force=3000.0)).pressure
    assert pressures.min() > 0.0
    return pressures.mean() - pressures.min()


def with_slopes(surface):
    material = Material(young_modulus=YOUNG, poisson_ratio=0.3)
    slopes = FiniteSlopes(surface, material, periodic=True)
    modulus = YOUNG / (1.0 - 0.3**2)
    return HalfSpaceModel(surface, contact_modulus=modulus, periodic=True, slopes=(slopes,))


def steep(seed):
    spectrum = Spectrum(hurst=0.8, waves=(1, 4), rms_slope=0.2, seed=seed)
    return replace(synthesise(spectrum, grid=(24, 24), lengths=(1.0, 1.0)), periodic=True)


def test_full_contact_goes_on_with_a_hundredth_of_the_compliance():
    full = flattening(HalfSpaceModel(SAMPLES[0], contact_modulus=MODULUS, periodic=True))
    law = representative_law(SAMPLES[:1], MODULUS, largest_pressure=2.0 * full)
    assert law.is_function
    assert law.rows.pressure[-1] == pytest.approx(2.0 * full, rel=1e-9)
    closed = law.initial_separation
    (row,) = np.flatnonzero(law.rows.closure == closed)
    assert law.rows.pressure[row] == pytest.approx(full, rel=1e-9)
    assert law.rows.contact_area_fraction[row] == 1.0
    beyond = law.at(np.linspace(closed, law.range[1], 9))
    assert np.all(np.diff(beyond.pressure) > 0.0)
    # closed, whatever the closure says; between the rows two interpolants differ
    assert np.abs(beyond.separation).max() < 1e-3 * closed
    assert law.range[1] - closed == pytest.approx(0.01 * (closed - law.first_touch), rel=1e-6)
    # the half-space of the roughness goes on, too: one compliance for all rows
    layer = law.rows.approach - law.rows.closure
    assert layer == pytest.approx(layer[row] / full * law.rows.pressure, rel=1e-9)
    # and so do the tangents beyond the last row
    assert law.stiffness(1.001 * law.range[1]) == pytest.approx(100 * full / closed, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize(
    "beyond", [1e-12, *(pytest.param(one, marks=pytest.mark.slow) for one in (1e-15, 1e-6))]
)
def test_a_law_ends_anywhere_about_full_contact(beyond):
    """Just beyond it, closures of a hundredth of the compliance are lost in rounding."""
    for samples in (SAMPLES[:1], SAMPLES):
        whole = representative_law(samples, MODULUS, largest_pressure=3e3, tolerance=0.02)
        full = whole.rows.contact_area_fraction >= 1.0
        pressure = float(whole.rows.pressure[full][0]) * (1.0 + beyond)
        law = representative_law(samples, MODULUS, largest_pressure=pressure, tolerance=0.02)
        assert law.rows.pressure[-1] == pytest.approx(pressure, rel=1e-9)  # of its end, `_CLOSE`


def test_with_finite_slopes_a_law_ends_at_a_hundredth_of_its_mean_compliance():
    sample = PeriodicSample(with_slopes(steep(0)))
    end = sample.closed.row[0]
    below, here, above = (
        sample.model.press(Control(force=factor * end)).approach for factor in (0.98, 1.0, 1.02)
    )
    full = 0.01 * sample.first_touch / flattening(sample.model)
    assert (above - here) / (0.02 * end) < full < (here - below) / (0.02 * end)


@pytest.mark.long
@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_with_finite_slopes_a_law_ends_where_the_approach_turns_back(count):
    """There is a force at each approach; the last one is less than that of full contact."""
    given = [steep(seed) for seed in range(count)]
    modulus = YOUNG / (1.0 - 0.3**2)
    law = representative_law(given, modulus, largest_pressure=0.8 * YOUNG, make_model=with_slopes)
    rows, closed = law.rows, law.initial_separation
    assert law.is_function and (rows.contact_area_fraction[-4:] == 1.0).all()
    last = len(rows) - 5
    models = [with_slopes(surface) for surface in given]
    for row in (last // 2, last - 2, last - 1):
        lower = closed - np.array(
            [one.reference_height - one.surface.mean_height for one in models]
        )
        states = [
            one.solve(rows.closure[row] - below) for one, below in zip(models, lower, strict=True)
        ]
        mean = np.mean([state.mean_pressure for state in states])
        assert rows.pressure[row] == pytest.approx(mean, rel=3e-4)  # 5e-4 of 3e-3, times 30
    assert rows.closure[last] > closed  # heights are compressed, too
    assert 0.9 < rows.contact_area_fraction[last] < 1.0
    assert law.at(rows.closure).separation.min() > -1e-12 * closed
    if count == 1:
        approaches = [
            models[0].press(Control(force=factor * rows.pressure[last])).approach
            for factor in (0.97, 1.0, 1.15)
        ]
        assert (
            approaches[0]
            < approaches[1]
            == pytest.approx(
                rows.closure[last],
                rel=3e-5,  # slopes of rows change by 1.5e-5 at the end
            )
        )
        # the compliance has fallen to a hundredth or less: the rest is less than 2 % of that
        assert max(approaches) - approaches[1] < 3e-3 * 0.15 * closed
    longer = representative_law(
        given, modulus, largest_pressure=1.6 * YOUNG, make_model=with_slopes, before=law
    )
    assert longer.rows.pressure[: last + 1] == pytest.approx(rows.pressure[: last + 1], rel=1e-12)
    assert longer.rows.pressure[-1] == pytest.approx(1.6 * YOUNG, rel=1e-9)


def test_a_law_that_ends_before_first_touch_is_open():
    law = representative_law(SAMPLES, MODULUS, largest_closure=1e-7)
    assert law.is_open
    assert law.first_touch > 1e-7
    assert law.pressure_scatter(np.zeros(2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"samples": []}, "a representative law needs a sample"),
        ({"largest_pressure": None}, "a representative law needs an end"),
        ({"largest_pressure": 0.0}, "largest_pressure = 0.0: must be greater"),
        ({"largest_closure": float("nan")}, "largest_closure = nan: must be a finite number"),
        ({"samples": [replace(SAMPLES[0], periodic=False)]}, "needs a periodic surface"),
        ({"samples": [replace(SAMPLES[0], heights=np.ones((8, 8)))]}, "a flat sample has no law"),
        (
            {"make_model": lambda surface: HalfSpaceModel(surface, contact_modulus=MODULUS)},
            "a representative law needs periodic models",
        ),
    ],
)
def test_bad_input_is_refused(change, message):
    options = {"samples": SAMPLES[:1], "largest_pressure": 1.0} | change
    with pytest.raises(InputError, match=message):
        representative_law(contact_modulus=MODULUS, **options)


def test_progress_is_observed():
    seen = []
    law = representative_law(
        SAMPLES[:2], MODULUS, largest_closure=0.01, observe=lambda *words: seen.append(words)
    )
    counts = [done for _, done, _ in seen]
    assert counts == sorted(counts)
    assert counts[-1] >= len(law.rows)
    assert {(what, most) for what, _, most in seen} == {("rows of laws", 97)}


@pytest.fixture(scope="module")
def table():
    regions = {"inner": SAMPLES[2:], "outer ring": SAMPLES[:2]}
    return representative_laws(regions, MODULUS, largest_pressure=30.0)


@pytest.mark.long
def test_regions_share_one_mean_plane(table):
    alone = representative_law(SAMPLES[2:], MODULUS, largest_pressure=30.0)
    inner, outer = table["inner"], table["outer ring"]
    assert inner.initial_separation == outer.initial_separation == outer.at(0.0).separation
    lower = outer.initial_separation - alone.initial_separation
    assert lower > 1e-3
    closures = np.linspace(*alone.range, 30)
    moved = inner.at(closures + lower, extend=True)
    assert moved.pressure == pytest.approx(alone.at(closures).pressure, abs=1e-9)
    assert moved.separation == pytest.approx(alone.at(closures).separation, rel=1e-9)
    assert inner.first_touch == pytest.approx(alone.first_touch + lower, rel=1e-12)


def test_a_table_of_regions_survives_a_file(table):
    back = read_laws(BytesIO(law_bytes(table)))
    assert back.patches == Regions(("inner", "outer ring"))
    assert back.made_by == table.made_by
    assert back.made_by["samples"] == "1, 2"
    for law, copy in zip(table.laws, back.laws, strict=True):
        for name, column in copy.rows.columns():
            assert column.tobytes() == getattr(law.rows, name).tobytes(), name
        assert (law.sample_area, law.first_touch) == (copy.sample_area, copy.first_touch)
    with pytest.raises(InputError, match="not those of patches"):
        _ = back.grid
    with pytest.raises(InputError, match="there is no such region") as caught:
        back["outer rings"]
    assert "did you mean 'outer ring'" in str(caught.value)


def test_regions_are_exported_by_name(table):
    (text,) = export_texts(table, "csv").values()
    rows = list(csv.DictReader(StringIO(text)))
    assert {row["region"] for row in rows} == {"inner", "outer ring"}
    last = [row for row in rows if row["region"] == "outer ring"][-1]
    assert float(last["pressure_MPa"]) == pytest.approx(table["outer ring"].rows.pressure[-1])
    assert float(last["pressure_scatter_MPa"]) > 0.0
    (text,) = export_texts(table, "calculix").values()
    assert "NAME=REGION_INNER" in text and "NAME=REGION_OUTER_RING" in text
    names = list(export_texts(table, "4c", name="pad"))
    assert names == ["laws_4c/law_pad_inner.py", "laws_4c/law_pad_outer_ring.py"]


def test_a_report_says_how_samples_scatter(table):
    (note,) = [one for one in table.notes(1e-3) if "scatters" in one]
    assert note.startswith("outer ring: the pressure of single samples scatters about that")
    assert note.count("Pa (") == 3


@pytest.mark.parametrize("names", [(), ("a", "a"), ("a", "")])
def test_regions_need_names(names):
    with pytest.raises(InputError, match="the regions of a face need names"):
        Regions(names)


def test_a_table_needs_one_law_per_region(law):
    with pytest.raises(InputError, match="needs one law per patch"):
        LawTable(patches=Regions(("a", "b")), laws=(law,), made_by={})
