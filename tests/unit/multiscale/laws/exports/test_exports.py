"""Exported laws, read as the programs read them, against the laws themselves and closed forms."""

import csv
import importlib.util
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Friction, PatchGrid, Regions
from patchlaw.geometry.materials import mindlin_ratio
from patchlaw.multiscale import LawTable, PatchLaw, export_laws
from patchlaw.multiscale.laws import FORMATS
from patchlaw.multiscale.laws.export import remove_exports
from patchlaw.multiscale.laws.exported_law import LEAST_PRESSURE, sample_law
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.support.files import LIST

TOUCH = 1e-3


def law_of(closure, pressure, approach=None):
    """Return a law through rows."""
    closure, pressure = np.asarray(closure, float), np.asarray(pressure, float)
    columns = {
        "closure": closure,
        "pressure": pressure,
        "approach": closure if approach is None else np.asarray(approach, float),
        "contact_area_fraction": np.linspace(0.0, 0.2, len(closure)),
        "contacts": np.arange(len(closure)),
        "unresolved_displacement": np.zeros(len(closure)),
    }
    touch = closure[0] if len(closure) else 8e-3
    return PatchLaw(rows=LawRows(**columns), first_touch=float(touch), initial_separation=0.02)


def hertz(closure):
    return 4e3 * np.maximum(closure - TOUCH, 0.0) ** 1.5


def hertzian(rows=12):
    """A single asperity: its law is exact between rows, whatever their number."""
    closure = np.linspace(TOUCH, 9e-3, rows)
    return law_of(closure, hertz(closure))


def rough(rows=40):
    """Contacts that join one after the other, on a patch that yields: closure < approach."""
    approach = np.linspace(TOUCH, 1.2e-2, rows)
    depth = approach - TOUCH
    pressure = 3e3 * depth**1.5 + 9e3 * np.maximum(depth - 4e-3, 0.0) ** 1.5
    return law_of(approach - 2e-4 * pressure, pressure, approach)


def table_of(*laws):
    patches = PatchGrid(grid=(len(laws), 1), lengths=(1.0 * len(laws), 1.0))
    return LawTable(patches=patches, laws=laws, made_by={"coupling": "consistent"})


def tables_in(text):
    """Return the tables of a keyword file by name: pressures and overclosures."""
    found, name = {}, None
    assert text.isascii()
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*SURFACE INTERACTION"):
            name = line.rpartition("NAME=")[2]
        elif line.startswith("*SURFACE BEHAVIOR"):
            assert line.endswith("PRESSURE-OVERCLOSURE=TABULAR")
            found[name] = []
        else:
            words = line.split(",")
            assert all(len(word.strip()) <= 20 for word in words)  # CalculiX reads no more
            found[name].append([float(word) for word in words])
    return {name: np.array(rows).T for name, rows in found.items()}


def module_at(path):
    """Import a module as 4C does."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


LAWS = {"one asperity": hertzian, "rough": rough, "two rows": lambda: hertzian(2)}


@pytest.mark.parametrize("program", ["abaqus", "calculix"])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_tables_of_contact_programs_are_within_their_stated_error(tmp_path, law, program):
    law_is_hertz, law = law is not rough, law()
    (path,) = export_laws(table_of(law), tmp_path, program)
    text = path.read_text(encoding="ascii")
    pressure, closure = tables_in(text)["PATCH_0_0"]
    assert pressure[0] == 0.0 and closure[0] == pytest.approx(law.first_touch, rel=1e-12)
    assert np.all(np.diff(pressure) > 0.0) and np.all(np.diff(closure) > 0.0)
    end = law.range[1]
    known = closure <= end * (1 + 1e-12)
    assert np.count_nonzero(~known) == (program == "calculix")  # which would keep the pressure
    if program == "abaqus":  # exact at the rows, to the 13 digits written
        expected = law.pressure(closure[known])
        np.testing.assert_allclose(pressure[known], expected, rtol=1e-9, atol=1e-12)
    else:  # what mortar contact wants; 13 digits are written
        assert len(pressure) <= 40
        slope = np.diff(pressure) / np.diff(closure)
        assert np.all(np.diff(slope) > -1e-9 * slope[1:])
    points = np.linspace(0.0, end, 1000)
    exact = law.pressure(points)
    scale = np.maximum(exact, LEAST_PRESSURE * exact[-1])
    error = np.max(np.abs(np.interp(points, closure, pressure) - exact) / scale)
    (stated,) = [float(line.split(":")[1]) for line in text.splitlines() if "largest error" in line]
    assert error <= 1.05 * stated  # stated with two digits
    # 39 rows on p = c^1.5 err by 1.2e-3 by the closed form below, off the law by less;
    # contacts that join have more to be followed
    assert stated <= (1.0e-4 if program == "abaqus" else 1e-3 if law_is_hertz else 1.5e-3)


def test_rows_for_a_closed_form_are_as_few_as_its_curvature_lets_them_be():
    # chords of d^1.5 err by 0.75 h² / (8 d² ) of the pressure: h = d √(8 tol / 0.75) from row to
    # row, down to the depth with 1 % of the pressure; below, as many again as 1 % takes: h ~ d^¼
    law, tolerance = hertzian(400), 1e-3
    sample = sample_law(law, tolerance=tolerance)
    step = np.sqrt(8 * tolerance / 0.75)
    expected = np.log(100.0 ** (2 / 3)) / step + (4 / 3) / step
    assert len(sample.closure) == pytest.approx(expected, rel=0.1)
    assert 0.7 * tolerance < sample.error <= tolerance


def test_calculix_gets_no_more_rows_than_it_stores(tmp_path):
    closure = np.linspace(TOUCH, 9e-3, 97)
    waves = law_of(closure, hertz(closure) * (1.0 + 0.02 * np.sin(6e3 * closure)))
    (path,) = export_laws(table_of(waves), tmp_path, "calculix", tolerance=1e-6)
    pressure, closure = tables_in(text := path.read_text())["PATCH_0_0"]
    assert 35 < len(pressure) <= 40
    (stated,) = [float(line.split(":")[1]) for line in text.splitlines() if "largest error" in line]
    assert 1e-4 < stated < 2e-2
    # its waves are no error of its interpolation, so that it keeps them
    slope = np.diff(pressure) / np.diff(closure)
    assert np.any(np.diff(slope) < 0.0)
    assert "Its slope falls: TYPE=NODE TO SURFACE alone" in text


def test_wavering_slopes_are_made_to_rise_within_the_error_of_the_interpolation(tmp_path):
    """Under TYPE=MORTAR CalculiX loses the pressure where the slope of a table falls."""
    closure = np.linspace(TOUCH, 9e-3, 97)
    pressure = hertz(closure) * (1.0 + 3e-3 * np.sin(6e3 * closure))
    for known in (0.0, 1e-2):
        law = replace(law_of(closure, pressure), interpolation_error=known)
        (path,) = export_laws(table_of(law), tmp_path, "calculix")
        found, at = tables_in(text := path.read_text())["PATCH_0_0"]
        slope = np.diff(found) / np.diff(at)
        rises = bool(np.all(np.diff(slope) > -1e-9 * slope[1:]))
        assert rises == (known > 0.0) == ("Its slope falls" not in text)
    points = np.linspace(TOUCH, 9e-3, 2000)
    exact = law.pressure(points)
    scale = np.maximum(exact, LEAST_PRESSURE * exact[-1])
    error = np.max(np.abs(np.interp(points, at, found) - exact) / scale)
    (stated,) = [float(line.split(":")[1]) for line in text.splitlines() if "largest error" in line]
    assert error <= 1.05 * stated <= 6e-3  # of waves from -3e-3 to 3e-3


def test_tables_for_calculix_do_not_begin_across_a_gap(tmp_path):
    """Closures from the mean plane are negative at first touch, where CalculiX has no springs."""
    zero = 0.02
    plain, moved = table_of(hertzian()), table_of(hertzian()).counted_from("mean plane", zero)
    texts = [export_laws(one, tmp_path, "calculix")[0].read_text() for one in (plain, moved)]
    expected, found = (tables_in(text)["PATCH_0_0"] for text in texts)
    assert found[1][0] == 0.0
    np.testing.assert_allclose(found[1], expected[1] - TOUCH, atol=1e-15)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-12)
    assert "a rigid plane at the height of the highest point of the roughness.\n" in texts[0]
    assert "a rigid plane 0.019 mm above the mean of the heights of the roughness.\n" in texts[1]
    assert all(len(line) <= 100 for line in texts[1].splitlines() if line.startswith("** O"))
    # first touch lies at the same height over the mean plane
    mean = [float(re.search(r"mean plane (\S+) mm below", text)[1]) for text in texts]
    assert mean[0] - TOUCH == pytest.approx(mean[1], abs=1e-11)
    (path,) = export_laws(moved, tmp_path, "abaqus")  # which knows pressures across gaps
    assert tables_in(path.read_text())["PATCH_0_0"][1][0] == pytest.approx(TOUCH - zero)


def test_falling_pressures_are_evened_out_for_contact_programs_and_said(tmp_path):
    closure = np.linspace(TOUCH, 9e-3, 30)
    pressure = hertz(closure)
    pressure[20:24] = 0.97 * pressure[19]
    (path,) = export_laws(table_of(law_of(closure, pressure)), tmp_path, "abaqus")
    found, _ = tables_in(text := path.read_text())["PATCH_0_0"]
    assert np.all(np.diff(found) > 0.0)
    assert "falling pressures evened out by" in text
    (stated,) = [float(line.split(":")[1]) for line in text.splitlines() if "largest error" in line]
    assert 5e-3 < stated < 5e-2  # of the change, not of the straight lines


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_module_for_4c_is_the_interpolant(tmp_path, law):
    law = law()
    (path,) = export_laws(table_of(law), tmp_path, "4c")
    module, offset = module_at(path), 2e-4
    closures = np.concatenate([np.linspace(0.0, 1.3 * law.range[1], 1000), law.rows.closure])
    found = [module.evaluate(-closure - offset, offset) for closure in closures]
    np.testing.assert_allclose(found, -law.pressure(closures), rtol=1e-11, atol=1e-13)
    slopes = [module.evaluate_derivative(-closure - offset, offset) for closure in closures]
    np.testing.assert_allclose(slopes, law.stiffness(closures), rtol=1e-9, atol=1e-9)
    # 4C's other laws: negative in compression, the derivative over the gap positive
    gap, h = -0.6 * law.range[1], 1e-9
    difference = (module.evaluate(gap + h, 0.0) - module.evaluate(gap - h, 0.0)) / (2 * h)
    assert module.evaluate(gap, 0.0) < 0.0
    assert module.evaluate_derivative(gap, 0.0) == pytest.approx(difference, rel=1e-4)


def test_module_for_4c_needs_nothing_else(tmp_path):
    export_laws(table_of(rough()), tmp_path, "4c", name="pad")
    path = tmp_path / "laws_4c" / "law_pad_0_0.py"
    code = "import sys; from law_pad_0_0 import evaluate; "
    code += "print(evaluate(-5e-3, 0.0), 'numpy' in sys.modules)"
    shown = subprocess.run(
        [sys.executable, "-S", "-c", code], cwd=path.parent, capture_output=True, text=True
    )
    pressure, numpy_is_loaded = shown.stdout.split()
    assert float(pressure) == pytest.approx(-rough().pressure(5e-3), rel=1e-11)
    assert numpy_is_loaded == "False"


def test_csv_has_all_columns_of_every_touched_patch(tmp_path):
    law = rough()
    (path,) = export_laws(table_of(law, law_of([], []), hertzian()), tmp_path, "csv")
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["ix"] for row in rows} == {"0", "2"}
    first = [row for row in rows if row["ix"] == "0"]
    columns = {name: np.array([float(row[name]) for row in first]) for name in first[0]}
    point = law.along(columns["approach_mm"])
    for name, expected in (
        ("closure_mm", point.closure),
        ("pressure_MPa", point.pressure),
        ("stiffness_MPa_per_mm", point.stiffness),
        ("contact_area_fraction", point.contact_area_fraction),
        ("separation_mm", point.separation),
        ("contacts", point.contacts),
    ):
        np.testing.assert_array_equal(columns[name], expected)
    assert columns["closure_mm"][-1] == law.range[1]


def test_closures_that_fall_end_the_tables_but_not_the_csv_file(tmp_path):
    approach = np.linspace(TOUCH, 9e-3, 20)
    pressure = hertz(approach)
    closure = np.where(approach < 6e-3, approach, 1.2e-2 - approach)  # near full contact
    law = law_of(closure, pressure, approach)
    (path,) = export_laws(table_of(law), tmp_path, "abaqus")
    assert "The law ends where pressure stops being a function of closure." in path.read_text()
    _, overclosure = tables_in(path.read_text())["PATCH_0_0"]
    assert overclosure[-1] == pytest.approx(law.range[1], rel=1e-12)
    (path,) = export_laws(table_of(law), tmp_path, "csv")
    lines = path.read_text().splitlines()
    assert float(lines[-1].split(",")[2]) == approach[-1]


def test_a_pressure_that_is_a_function_nowhere_is_refused(tmp_path):
    closure = TOUCH - np.linspace(0.0, 1e-3, 5)
    flat = law_of(closure, np.linspace(0.0, 3.0, 5), np.linspace(TOUCH, 9e-3, 5))
    table = table_of(hertzian(), flat)
    for program in ("4c", "abaqus", "calculix"):
        with pytest.raises(InputError, match=r"pressure of patch \(1, 0\) is no function of"):
            export_laws(table, tmp_path, program)
    assert not list(tmp_path.iterdir())
    assert export_laws(table, tmp_path, "csv") == [tmp_path / "laws.csv"]


def test_open_patches_have_no_interaction_and_no_pressure(tmp_path):
    table = table_of(law_of([], []), hertzian())
    (path,) = export_laws(table, tmp_path, "calculix")
    assert list(tables_in(path.read_text())) == ["PATCH_1_0"]
    assert "It stays open: no surface interaction" in path.read_text()
    module = module_at(export_laws(table, tmp_path, "4c")[0])
    assert (module.evaluate(-0.5, 0.0), module.evaluate_derivative(-0.5, 0.0)) == (0.0, 0.0)


REGIONS = {
    ("outer ring", "Nabe (\u00d8 12)"): ["outer_ring", "nabe_12"],
    ("a/b", "a b"): ["0", "1"],  # one label for both
    ("\u00e4", "b"): ["0", "1"],  # a name without a letter that every program reads
    ('say """', "b\n*STEP"): ["say", "b_step"],
}


@pytest.mark.parametrize(("names", "labels"), REGIONS.items())
def test_regions_keep_their_names_where_programs_can_read_them(tmp_path, names, labels):
    table = LawTable(patches=Regions(names), laws=(hertzian(), rough()), made_by={"of": names[0]})
    (path,) = export_laws(table, tmp_path, "abaqus")
    assert list(tables_in(path.read_text("ascii"))) == [f"REGION_{one}".upper() for one in labels]
    assert "*STEP" not in path.read_text().splitlines()
    for path, law in zip(export_laws(table, tmp_path, "4c"), table.laws, strict=True):
        assert path.stem.partition("law_")[2].partition("_")[2] in labels
        assert module_at(path).evaluate(-4e-3, 0.0) == pytest.approx(-law.pressure(4e-3), rel=1e-11)
    (path,) = export_laws(table, tmp_path, "csv")
    with path.open(encoding="utf-8", newline="") as file:
        assert list(dict.fromkeys(row["region"] for row in csv.DictReader(file))) == list(names)


def test_two_exports_meet_in_one_input(tmp_path):
    """4C imports modules of a name once; CalculiX takes the first of two interactions of a name."""
    code = (
        "import sys, importlib as i\nfor p in sys.argv[1:]:\n f, n = p.rsplit('/', 1)\n sys.path."
    )
    code += "insert(0, f)\n print(i.import_module(n.removesuffix('.py')).evaluate(-4e-3, 0.0))"
    for names in (("", ""), ("pad", "disc")):
        paths, decks = [], []
        for folder, law, name in zip("ab", (hertzian(), rough()), names, strict=True):
            paths += export_laws(table_of(law), tmp_path / folder, "4c", name=name)
            decks += export_laws(table_of(law), tmp_path / folder, "calculix", name=name)
        words = [sys.executable, "-c", code, *map(str, paths)]
        shown = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
        expected = [-law.pressure(4e-3) for law in (hertzian(), rough())]
        np.testing.assert_allclose(list(map(float, shown)), expected, rtol=1e-11)
    found = [name for path in decks for name in tables_in(path.read_text())]
    assert found == ["PAD_PATCH_0_0", "DISC_PATCH_0_0"]
    with pytest.raises(InputError, match="name = 'pad on disc': does not fit into names"):
        export_laws(table_of(rough()), tmp_path, "calculix", name="pad on disc")


@pytest.mark.parametrize("format", ["csv", "abaqus", "calculix"])
def test_friction_of_laws_without_a_ratio_asks_for_poissons_ratio(tmp_path, format):
    table = table_of(hertzian())
    with pytest.raises(InputError, match=r"allowed: Friction\(coefficient=…, poisson_ratio=…\)"):
        export_laws(table, tmp_path, format, friction=0.3)
    assert not list(tmp_path.iterdir())
    known = Friction(coefficient=0.3, poisson_ratio=0.25)
    (path,) = export_laws(table, tmp_path, format, friction=known)
    text = path.read_text()
    ratio = mindlin_ratio(0.25)
    same = table.with_stiffness_ratios([ratio])
    assert export_laws(same, tmp_path / "same", format, friction=0.3)[0].read_text() == text
    assert "nan" not in text


@pytest.mark.parametrize("format", ["abaqus", "calculix", "4c"])
def test_a_table_of_a_law_of_ones_own_does_not_say_how_it_was_made(tmp_path, format):
    patches = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    for how, said in (({}, False), ({"coupling": "isolated"}, True)):
        table = LawTable(patches=patches, laws=(rough(),), made_by=how)
        (path,) = export_laws(table, tmp_path, format)
        assert ("Made by:" in path.read_text()) == said


def test_unknown_formats_are_refused(tmp_path):
    with pytest.raises(InputError, match="allowed: csv, 4c, abaqus, calculix"):
        export_laws(table_of(hertzian()), tmp_path, "ansys")


def test_a_file_of_the_users_own_is_not_replaced(tmp_path):
    mine = tmp_path / "laws.csv"
    mine.write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"folder = .*: holds laws\.csv, which is no result of"):
        export_laws(table_of(hertzian()), tmp_path, "csv")
    assert [path.name for path in tmp_path.iterdir()] == ["laws.csv"]
    assert mine.read_text(encoding="utf-8") == "mine"


def test_exports_of_earlier_laws_go(tmp_path):
    for name in FORMATS:
        export_laws(table_of(hertzian(), rough()), tmp_path, name)
    (tmp_path / "laws_4c" / "law_mine.py").write_text("")
    assert len(list(tmp_path.rglob("*.*"))) == 3 + 2 + 1 + 1  # and the list of them
    export_laws(table_of(rough()), tmp_path, "4c")
    assert not (tmp_path / "laws_4c" / "law_1_0.py").exists()
    remove_exports(tmp_path)
    assert {path.name for path in tmp_path.rglob("*.*")} == {"law_mine.py", LIST}


def conducts(stiffness):
    """What `Conductances.per_area` gives, of a pair with h = 5 dp/dc."""
    return {"thermal_conductance_W_per_m2K": 5.0 * stiffness}


def test_conductance_per_area_is_exported(tmp_path):
    """Conductance over pressure: of Hertz' law dp/dc = 1.5 · 4000^(2/3) p^(1/3)."""
    table = table_of(hertzian())
    for format, mark in (("abaqus", ""), ("calculix", "** ")):
        (path,) = export_laws(table, tmp_path, format, conducts=conducts)
        before, after = path.read_text().split(f"{mark}*GAP CONDUCTANCE, PRESSURE\n")
        (name,) = tables_in(before)
        lines = [line.removeprefix(mark) for line in after.splitlines()]
        rows = np.array([[float(word) for word in line.split(",")] for line in lines])
        conductance, pressure = rows.T
        assert name == "PATCH_0_0"
        assert pressure[0] == 0.0
        expected = 5.0e-3 * 1.5 * 4e3 ** (2 / 3) * np.cbrt(pressure)
        # gaps are interpolated by their logarithms, those of this law fall in proportion
        np.testing.assert_allclose(conductance, expected, rtol=2e-3, atol=1e-9)
    (path,) = export_laws(table, tmp_path, "csv", conducts=conducts)
    rows = list(csv.DictReader(path.open()))
    for row in rows:
        found = float(row["thermal_conductance_W_per_m2K"])
        # the interface's own, which interpolates otherwise than the derivative by the closure
        assert found == pytest.approx(5.0 * float(row["stiffness_MPa_per_mm"]), rel=2e-2)
    for format in FORMATS:
        for path in export_laws(table, tmp_path, format):
            assert "onductance" not in path.read_text().replace("gap conductance", "")


@pytest.mark.parametrize(
    ("format", "name"), [("calculix", "laws_calculix.inp"), ("abaqus", "laws_abaqus.inp")]
)
def test_friction_is_exported_in_the_words_of_the_program(tmp_path, format, name):
    ratio, law = 1.3, hertzian()
    table = table_of(law).with_stiffness_ratios([ratio])
    export_laws(table, tmp_path, format, friction=0.37)
    text = (tmp_path / name).read_text()
    lines = text.splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("*FRICTION"))
    values = [float(value) for value in lines[at + 1].split(",") if value]
    assert values[0] == 0.37
    # the first row of the table from half of the largest pressure on
    stated = float(re.search(r"([0-9.e+]+) MPa; over", text).group(1))
    assert 0.5 <= stated / hertz(9e-3) <= 0.52
    if format == "calculix":
        stiffness = values[1]
    else:  # the slip over which sticking goes up to the bound
        stiffness = 0.37 * stated / float(lines[at].split("=")[1])
    closure = TOUCH + (stated / 4e3) ** (2 / 3)
    # the pressure is stated in three digits
    assert stiffness == pytest.approx(float(law.stiffness(closure)) / ratio, rel=0.01)
    export_laws(table, tmp_path, format)
    assert "*FRICTION" not in (tmp_path / name).read_text()


def test_tangential_stiffness_is_a_column_with_friction(tmp_path):
    table = table_of(hertzian()).with_stiffness_ratios([1.25])
    (path,) = export_laws(table, tmp_path, "csv", friction=0.2)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 10
    for row in rows:
        along = float(row["tangential_stiffness_MPa_per_mm"])
        assert along == pytest.approx(float(row["stiffness_MPa_per_mm"]) / 1.25)
