"""Another program conducts heat through our exported laws: CalculiX, two cubes in contact."""

import re

import numpy as np
import pytest
from helpers import calculix

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale import LawTable, PatchLaw, export_laws
from patchlaw.multiscale.laws.rows import LawRows

pytestmark = pytest.mark.skipif(calculix.PROGRAM is None, reason="CalculiX is not installed")

TOUCH, CONDUCTIVITY, FACTOR = 1e-4, 50.0, 30.0
"""First touch [mm], conductivity of the cubes [mW/mm/K], and W/m²/K per MPa/mm."""

DECK = """\
*NODE, NSET=ALL
{nodes}
*ELEMENT, TYPE=C3D8, ELSET=CUBES
1, 1, 2, 3, 4, 5, 6, 7, 8
2, 9, 10, 11, 12, 13, 14, 15, 16
*NSET, NSET=BOTTOM
1, 2, 3, 4
*NSET, NSET=TOP
13, 14, 15, 16
*MATERIAL, NAME=SOLID
*ELASTIC
1e6, 0.0
*CONDUCTIVITY
{conductivity}
*SOLID SECTION, ELSET=CUBES, MATERIAL=SOLID
*INITIAL CONDITIONS, TYPE=TEMPERATURE
ALL, 0.0
*INCLUDE, INPUT={laws}
*SURFACE, NAME=LOWER, TYPE=ELEMENT
1, S2
*SURFACE, NAME=UPPER, TYPE=ELEMENT
2, S1
*CONTACT PAIR, INTERACTION=PATCH_0_0, TYPE=NODE TO SURFACE
LOWER, UPPER
*STEP, INC=100
*COUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE
1.0, 1.0
*BOUNDARY
ALL, 1, 2, 0.0
BOTTOM, 3, 3, 0.0
TOP, 3, 3, {moved}
BOTTOM, 11, 11, 0.0
TOP, 11, 11, 100.0
*NODE PRINT, NSET=BOTTOM, TOTALS=ONLY
RF
*NODE PRINT, NSET=ALL
NT
*END STEP
"""


def table_of_one():
    """A law p = 2e6 (c − c0)^1.5."""
    closure = np.linspace(TOUCH, 2e-3, 12)
    zeros = np.zeros(len(closure))
    rows = LawRows(
        closure=closure,
        approach=closure,
        pressure=2e6 * (closure - TOUCH) ** 1.5,
        contact_area_fraction=zeros,
        contacts=np.zeros(len(closure), int),
        unresolved_displacement=zeros,
    )
    law = PatchLaw(rows=rows, first_touch=TOUCH, initial_separation=0.02)
    patches = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    return LawTable(patches=patches, laws=(law,), made_by={"coupling": "isolated"})


def solved(folder, moved, laws):
    """Return the pressure [MPa], and the temperatures of both faces, of cubes of 1 mm."""
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    places = [(x, y, z) for z in (-1, 0, 0, 1) for x, y in square]
    nodes = "\n".join(f"{k + 1}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(places))
    deck = DECK.format(nodes=nodes, laws="laws.inp", moved=-moved, conductivity=CONDUCTIVITY)
    (folder / "cubes.inp").write_text(deck)
    (folder / "laws.inp").write_text(laws)
    text, word = calculix.printed(folder, "cubes"), r"[-+]?\d\.\d+E[-+]\d+"
    (force,) = re.findall(rf"^ +{word} +{word} +({word})$", text, re.MULTILINE)
    found = dict(re.findall(rf"^ +(\d+) +({word})$", text, re.MULTILINE))
    return float(force), float(found["5"]), float(found["9"])


def table_in(text, mark):
    """Return conductances and pressures of a table of gap conductance."""
    after = text.split(f"{mark}*GAP CONDUCTANCE, PRESSURE\n")[1].splitlines()
    return np.array([line.removeprefix(mark).split(",") for line in after], float).T


@pytest.mark.parametrize("moved", [5e-4, 1e-3])
def test_heat_through_an_exported_law(tmp_path, moved):
    """The value of the table at the pressure that CalculiX finds conducts as Barber's law says."""

    def conducts(stiffness):
        return {"thermal_conductance_W_per_m2K": FACTOR * stiffness}

    (path,) = export_laws(table_of_one(), tmp_path, "calculix", conducts=conducts)
    laws = path.read_text()
    pressure, *_ = solved(tmp_path, moved, f"{laws}*GAP CONDUCTANCE\n1.0\n")
    conductance = np.interp(pressure, *table_in(laws, "** ")[::-1])
    stiffness = 1.5 * 2e6 ** (2 / 3) * np.cbrt(pressure)
    # straight lines between rows
    assert conductance == pytest.approx(1e-3 * FACTOR * stiffness, rel=1e-3)
    given = f"{laws}*GAP CONDUCTANCE\n{conductance:.12e}\n"
    again, below, above = solved(tmp_path, moved, given)
    assert again == pytest.approx(pressure, rel=1e-6)
    assert CONDUCTIVITY * below == pytest.approx(conductance * (above - below), rel=1e-4)


def test_a_table_over_pressure_would_conduct_nothing(tmp_path):
    """Why exports for CalculiX have it as a comment."""
    (path,) = export_laws(
        table_of_one(), tmp_path, "calculix",
        conducts=lambda stiffness: {"thermal_conductance_W_per_m2K": FACTOR * stiffness},
    )  # fmt: skip
    laws = path.read_text()
    rows = "\n".join(f"{h}, {p}" for h, p in table_in(laws, "** ").T)
    pressure, below, above = solved(tmp_path, 1e-3, f"{laws}*GAP CONDUCTANCE\n{rows}\n")
    assert pressure > 1.0
    assert (below, above) == pytest.approx((0.0, 100.0), abs=1e-6)
