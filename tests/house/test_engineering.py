"""The page on what engineers read off is true: its scene gives the numbers it prints."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.waiting_ranks import alone

from patchlaw.multiscale import Scene, run

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "engineering.md").read_text(encoding="utf-8")


@pytest.mark.long
def test_numbers_of_the_page():
    scene = Scene.load(ROOT / "demos" / "scenes" / "pressed_steel.toml", ["output.check=none"])
    history = run(scene)
    first, relieved, last = (history.steps[k] for k in (3, 7, 11))
    for step in (first, relieved, last):
        area, stiffness = 100 * step.contact_area_fraction, 1e-3 * step.interface_stiffness_N_per_mm
        assert f"| {1e3 * step.approach_mm:.3f} µm (" in PAGE
        assert f"| {area:.4g} % (" in PAGE
        assert f"| {stiffness:.1f} kN/mm (" in PAGE
    part = "`stiffness_scatter`, the part of its error by single cells, is"
    assert f"{part} {100 * first.stiffness_scatter:.0f} %" in PAGE
    assert first.interface_stiffness_error_N_per_mm is None
    energies = last.elastic_energy_mJ, last.plastic_work_mJ, last.work_mJ
    assert "{:.3f}, {:.3f} and {:.3f} mJ".format(*energies) in PAGE
    assert f"volume, {last.plastic_work_mJ / 2000.0:.3e}".replace("e-04", "e-4") in PAGE
    assert f"`thermal_conductance_W_per_K` {last.thermal_conductance_W_per_K:.4f}" in PAGE
    assert f"`gap_conductance_W_per_K` {last.gap_conductance_W_per_K:.4f}" in PAGE
    assert f"`electrical_conductance_S` {last.electrical_conductance_S:.0f}" in PAGE
    data = {key: part for key, part in scene.written.items() if key != "micro"}
    elastic = run(Scene.from_dict(data))
    assert "pressures up to 19.5 GPa, 7.13 GPa in the mean" in PAGE
    (note,) = (note for note in elastic.notes if note.startswith("elastic contacts"))
    assert "up to 19.5 GPa, in the mean of the real contact area 7.13 GPa" in note
    for step, k in ((elastic.steps[3], 3), (elastic.steps[7], 7)):
        assert f"({1e3 * step.approach_mm:.3f})" in PAGE.replace("elastic ", ""), k
    conducted = elastic.thermal_conductance_W_per_K[-1]
    assert f"Elastic contacts would conduct {conducted:.4f} W/K" in PAGE


@pytest.mark.slow
def test_the_leak_on_the_page_is_that_of_its_scene():
    history = run(Scene.load(ROOT / "demos" / "scenes" / "leak.toml", ["output.figures=false"]))
    rows = re.findall(r"^\| (\d+) N \| (.*) % \| (.*?) \| (.*?) \|(.*)\|$", PAGE, re.MULTILINE)
    assert len(rows) == 5
    for force, area, *leaks, shares in rows:
        index = int(np.argmin(np.abs(history.force_N - float(force))))
        step = history.steps[index]
        assert 100.0 * step.contact_area_fraction == pytest.approx(float(area), abs=0.05)
        if leaks[0] == "closed":
            assert [leak.percolates for leak in step.leaks] == [0, 0]
            continue
        for direction, text in zip("xy", leaks, strict=True):
            value, error = (float(one) for one in re.findall(r"\d+\.\d+", text))
            powers = [float(f"1{one}") for one in re.findall(r"e-\d", text) or ["e0"]]
            value, error = value * powers[0], error * powers[-1]
            leak = step.leak(direction)
            assert leak.rate == pytest.approx(value, rel=0.02)
            most = "up to" in text
            assert leak.error == pytest.approx(error - value if most else error, rel=0.1)
        found = [leak.constriction for leak in step.leaks]
        said = [float(one) for one in re.findall(r"\d+", shares)]
        np.testing.assert_allclose(100.0 * np.array(found), said, atol=0.6)


@pytest.mark.long
def test_python_of_the_page_runs():
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    done = alone(["-c", example])
    assert done.returncode == 0, done.stderr
    *_, forth, back = (float(line.split()[-2]) for line in done.stdout.splitlines())
    assert back == pytest.approx(-forth, abs=0.011)  # at half the force all slides, both ways
