"""Tables as text and HTML; what shows itself does so in a shell, printed and in a notebook."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import (
    BodyFields,
    Comparison,
    ContactHistory,
    LawTable,
    PatchLaw,
    Scene,
    representative_law,
    sweep,
)
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.support.readable import Displayed, of_columns, spread, table_html, table_text


class Shown(Displayed):
    def displayed(self):
        return "two & three", (("name", "value"), [("a < b", "1.5"), ("c", "–")])


def test_columns_of_words_are_at_the_left_and_numbers_at_the_right():
    table = of_columns(["way", "fast", "x"], ["time [s]", "1.5 ± 0.1", "–"], ["more", "", ""])
    assert table_text(table).splitlines() == [
        "way    time [s]  more",
        "fast  1.5 ± 0.1",
        "x             –",
    ]
    assert table_text(((), ())) == ""


def test_reserved_characters_are_escaped():
    shown = table_html((["<h>", "b"], [['a < b & "c"', "1"]]), text_columns=(1,))
    assert "<th>&lt;h&gt;</th>" in shown and "<td>a &lt; b &amp; &quot;c&quot;</td>" in shown
    assert '<td class="text">1</td>' in shown


def test_what_is_displayed_is_a_line_and_a_table():
    assert repr(Shown()) == "<two & three>"
    assert str(Shown()).splitlines() == [
        "two & three",
        "name   value",
        "a < b    1.5",
        "c          –",
    ]
    assert Shown()._repr_html_().startswith("<p>two &amp; three</p><table><tr><th>name</th>")


def test_rows_are_left_out_at_equal_distances():
    assert spread(9, 3) == [0, 4, 8] and spread(2, 60) == [0, 1] and spread(0, 5) == []


@pytest.fixture(scope="module")
def surface():
    return synthesise(
        Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.1, seed=7), grid=(16, 16), lengths=(1.0, 0.5)
    )


def rows_and_line(thing):
    line, (heading, rows) = thing.displayed()
    assert repr(thing) == f"<{line}>" and len(str(thing).splitlines()) == len(rows) + 2
    assert all(len(row) == len(heading) for row in rows)
    return line, [dict(zip(heading, row, strict=True)) for row in rows]


def test_surfaces_states_and_laws_say_what_they_are(surface):
    line, rows = rows_and_line(surface)
    assert line == "Surface of 16 × 16 heights on 1 × 0.5 mm"
    assert rows[1] == {"": "rms height", "heights": f"{1e3 * np.std(surface.heights):.4g} µm"}
    state = HalfSpaceModel(surface, contact_modulus=4e3).press(Control(approach=2e-3))
    line, rows = rows_and_line(state)
    assert line == f"ContactState: {state.force:.6g} N at an approach of 2 µm"
    assert {"": "contacts", "value": str(state.contacts)} in rows
    law = representative_law([surface], contact_modulus=4e3, largest_pressure=5.0)
    line, rows = rows_and_line(law)
    assert "pressure 0 to 5 MPa" in line and len(rows) == min(12, len(law.rows))
    assert float(rows[-1]["pressure [MPa]"]) == pytest.approx(5.0, rel=1e-3)  # four digits
    open_one = PatchLaw(rows=LawRows.none(), first_touch=1e-2, initial_separation=2e-2)
    assert str(open_one).strip() == "PatchLaw of a patch that stays open"
    grid = PatchGrid(grid=(1, 2), lengths=(1.0, 1.0))
    table = LawTable(patches=grid, laws=(law, open_one), made_by={"model": "half-space"})
    line, rows = rows_and_line(table)
    assert line == f"LawTable of 2 laws in {table.rows} rows: half-space"
    assert [row["patch"] for row in rows] == ["0, 0", "0, 1"]
    assert [row["pressure there [MPa]"] for row in rows] == ["5", "0"]


def test_contacts_and_fields_say_what_they_are():
    spots = np.array([[0.1, 0.2, 3e-4, 2.0, 9e3]] * 25)
    record = ContactRecord(
        step=2, approach_mm=5e-4, force_N=50.0, lengths_mm=(1.0, 1.0), spots=spots
    )
    line, rows = rows_and_line(record)
    assert line == "ContactRecord of load step 2: 25 spots at 0.5 µm, 50 N; the 20 that carry most"
    assert rows[0]["area [µm²]"] == "300" and len(rows) == 20
    both = ContactHistory(records=(record, record))
    line, rows = rows_and_line(both)
    assert line == "ContactHistory of 2 load steps" and rows[1]["spots"] == "25"
    assert isinstance(both[1:], ContactHistory) and both[1:].force_N.tolist() == [50.0]
    slips = replace(record, slipping=np.eye(2, dtype=bool))
    assert ContactHistory(records=(slips, slips)).slipping.shape == (2, 2, 2)
    assert {"force_N", "slip_mm"} <= set(dir(both))
    with pytest.raises(AttributeError, match="no attribute 'slips'"):
        _ = both.slips
    fields = BodyFields(
        step=np.array([3]), points_mm=np.eye(4, 3), cells=np.array([[0, 1, 2, 3]]),
        cell_type="Tetrahedron", displacement_mm=np.ones((1, 4, 3)),
        stress_MPa=np.ones((1, 1, 3, 3)), von_mises_MPa=np.full((1, 1), 7.0),
    )  # fmt: skip
    line, rows = rows_and_line(fields)
    assert line == "BodyFields of load step 3: 4 vertices, 1 cells (Tetrahedron)"
    assert rows[-1] == {"field": "von_mises_MPa", "shape": "1 × 1", "least": "7", "largest": "7"}


def test_scenes_and_studies_say_what_they_are(surface):
    scene = Scene.from_dict(
        {
            "surface": {"heights": surface.heights, "lengths": ["1 mm", "0.5 mm"]},
            "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.2},
            "micro": {"model": "circular-independent"},
            "coupling": {"kind": "analytic"},
            "load": {"approach": "2 um", "steps": 1},
        }
    )
    line, rows = rows_and_line(scene)
    assert line == "Scene from Python"
    assert rows[0] == {"key": "surface.heights", "value": "16 × 16 numbers"}
    assert {"key": "load.approach", "value": "2 um"} in rows
    cases = sweep(scene, {"block.young_modulus": ["4 GPa", "8 GPa"]})
    line, rows = rows_and_line(cases)
    assert line == "SweepResults of 2 cases over block.young_modulus; the last load step of each"
    assert [row["block.young_modulus"] for row in rows] == ["4 GPa", "8 GPa"]
    assert float(rows[1]["force [N]"]) == pytest.approx(2 * float(rows[0]["force [N]"]), rel=1e-3)
    nothing = Comparison(scene="paper", rows=(), response="force")
    assert repr(nothing) == "<Comparison of 0 configurations of paper>"


def test_a_surface_is_shown_without_a_source():
    assert "source" not in str(Surface(heights=np.eye(4), lengths=(1.0, 1.0)))
