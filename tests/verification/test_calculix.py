"""Another program finds our forces and pressures: CalculiX, with our mesh and our exported laws.

The witness has linear elements, contact at the nodes of the face (its trapezoidal rule), and a
stiff plate with prescribed nodes for the rigid plane. With laws at the nodes we solve the same
discrete problem. Approaches are 1e-5 of the block's height, so that its large rotations of the
plane and ours, which are none, agree. Moduli of 1e9 MPa keep its forces above the absolute
tolerances of its Newton iteration. Mortar contact integrates over the facets, as our quadrature
does; it takes quadratic elements too.
"""

import functools
import re
import tomllib

import numpy as np
import pytest
from helpers import calculix
from helpers.block_cases import block_of
from helpers.small_scene import SMALL_SCENE

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import LawContactProblem, LoadedFace
from patchlaw.multiscale import LawTable, PatchLaw, Run, Scene, export_laws
from patchlaw.multiscale.laws.rows import LawRows

pytestmark = pytest.mark.skipif(calculix.PROGRAM is None, reason="CalculiX is not installed")
long = pytest.mark.long
APPROACH, LOAD = 8e-6, 1e9
WITHIN = 1.3e-3
"""Error of the tables that is stated."""
CONTROLS = {
    "level": Control(approach=APPROACH),
    "tilted": Control(approach=APPROACH, tilt=(0.1 * APPROACH, -0.2 * APPROACH)),
}


class Lines:
    """A law through rows as CalculiX reads it: straight lines between them."""

    def __init__(self, pressure, closure):
        self._pressure, self._closure = pressure, closure

    def pressure(self, closure):
        return np.interp(closure, self._closure, self._pressure)

    def stiffness(self, closure):
        slopes = np.diff(self._pressure) / np.diff(self._closure)
        slopes = np.concatenate([[0.0], slopes, [0.0]])  # before the table, and beyond
        return slopes[np.searchsorted(self._closure, closure, side="right")]


@functools.cache
def tabulated(patches):
    """Return laws of a rough surface whose patches differ."""
    scene = tomllib.loads(SMALL_SCENE)
    scene["coupling"]["kind"] = "isolated"
    scene["patches"]["grid"] = list(patches)
    scene["surface"]["spectrum"]["rms_slope"] = 2e-4
    scene["block"]["young_modulus"] = 4.0 * LOAD
    scene["load"]["approach"] = 1.2 * APPROACH
    return Run(Scene.from_dict(scene)).make_laws()


def exported_laws(patches, folder):
    """Return laws of a rough surface, the file that CalculiX reads, and its lines as laws."""
    table = tabulated(patches)
    (path,) = export_laws(table, folder, "calculix")
    rows, error = [], []
    for line in path.read_text(encoding="ascii").splitlines():
        if line.startswith("*SURFACE BEHAVIOR"):
            rows.append([])
        elif not line.startswith("*"):
            rows[-1].append([float(word) for word in line.split(",")])
        elif "largest error" in line:
            error.append(float(line.split(":")[1]))
    assert len(rows) == table.patches.count and max(map(len, rows)) <= 40
    assert max(error) < WITHIN
    return table, path, [Lines(*np.transpose(one)) for one in rows]


ONE, TWO = (1, 1), (2, 1)


@pytest.fixture(scope="module", params=[ONE, TWO], ids=["one law", "two laws"])
def exported(request, tmp_path_factory):
    return exported_laws(request.param, tmp_path_factory.mktemp("laws"))


STATES = {
    "light": Control(approach=0.3 * APPROACH),
    "level": Control(approach=APPROACH),
    "tilted": CONTROLS["tilted"],
    "last row": Control(approach=1.6 * APPROACH),
    "beyond": Control(approach=2.2 * APPROACH),
    "unloaded": Control(approach=0.5 * APPROACH),
    "open": Control(approach=-0.2 * APPROACH),
}
"""Loads one after the other. The laws end at 11 µm, of which contacts take 11.1 and 13.8."""
NODES = "NODE TO SURFACE"
ELEMENTS = {
    "C3D4": ("P1", False), "C3D8": ("Q1", False), "C3D10": ("P2", False),
    "C3D20": ("Q2", False), "C3D20R": ("Q2", True),
}  # fmt: skip
# 20 nodes are not our 27; of tilted planes facets that are half in contact differ
MORTAR = {"C3D4": 2e-4, "C3D8": 1e-4, "C3D10": 5e-5, "C3D20": 5e-4, "C3D20R": 5e-4}
CHEAP = [(ONE, "C3D8", "MORTAR"), (TWO, "C3D8", NODES)]
MORE = [
    *((ONE, kind, "MORTAR") for kind in ELEMENTS if kind != "C3D8"),
    *((TWO, kind, NODES) for kind in ELEMENTS if kind != "C3D8"),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("exported", "kind", "pairs"),
    [*CHEAP, *(pytest.param(*case, marks=long) for case in MORE)],
    indirect=["exported"],
    ids=str,
)
def test_every_state_has_the_force_of_the_table(tmp_path, exported, kind, pairs):
    table, path, lines = exported
    element, reduced = ELEMENTS[kind]
    block = block_of(element=element, cells=(4, 4, 3), young_modulus=LOAD)
    face = LoadedFace.of_block(block, table.patches)
    if pairs == NODES and element[1] == "1":
        face = calculix.NodalFace(block, face.facets, table.patches)
    # two laws: from one export each, in one deck
    files, names = [path], ["PATCH_0_0"]
    if table.patches.count == 2:
        named = ("pad", "disc")
        files = [export_laws(table, tmp_path / one, "calculix", name=one)[0] for one in named]
        names = ["PAD_PATCH_0_0", "DISC_PATCH_1_0"]
    controls = list(STATES.values())
    found = calculix.solve(
        tmp_path, face, files, *controls, pairs=pairs, reduced=reduced, interactions=names
    )
    assert len(found.reactions) == len(controls)
    by_lines = LawContactProblem(face, lines, "pointwise")
    by_laws = LawContactProblem(face, table.laws, "pointwise")
    for state, control, reaction in zip(STATES, controls, found.reactions[:, 2], strict=True):
        if state == "open":
            assert abs(reaction) < 1e-12
            continue
        off = reaction / by_lines.solve(control).force - 1.0
        if pairs == "MORTAR":
            assert abs(off) < MORTAR[kind], state
        elif kind.startswith("C3D20"):  # its corner nodes hardly count: what the page states
            assert -0.02 < off < -0.005, state
        else:  # quadratic tetrahedra integrate as we do where the table has no corners
            assert abs(off) < (2e-4 if kind == "C3D10" else 2e-6), state
        if not kind.startswith("C3D20") and state != "beyond":  # where the law is not known
            assert reaction == pytest.approx(by_laws.solve(control).force, rel=WITHIN), state


@pytest.mark.long
def test_no_load_of_an_exported_law_loses_its_force_under_mortar(tmp_path):
    """Where slopes of a table fall, CalculiX can take contact for open, at some loads.

    Rows that lie on this law have slopes that waver by 20 %; with them 4 of 16 loads have no force.
    """
    scene = tomllib.loads(SMALL_SCENE)
    scene["coupling"]["kind"] = "isolated"
    scene["patches"]["grid"] = [1, 1]
    scene["load"]["approach"] = "10 um"
    table = Run(Scene.from_dict(scene)).make_laws()
    (path,) = export_laws(table, tmp_path, "calculix")
    block = block_of(element="Q1", cells=(3, 3, 2), young_modulus=4e3)
    there, back = np.linspace(2e-3, 13.6e-3, 16), (8e-3, 4e-3)  # taken back in one increment each
    controls = [Control(approach=float(part)) for part in (*there, *back)]
    face = LoadedFace.of_block(block, table.patches)
    found = calculix.solve(tmp_path, face, path, *controls, pairs="MORTAR")
    problem = LawContactProblem(face, table.laws, "pointwise")
    expected = [problem.solve(control).force for control in controls]
    assert expected[0] > 0.0
    np.testing.assert_allclose(found.reactions[:, 2], expected, rtol=2.0 * WITHIN)


def faces_of(table, element, cells):
    """Return the same face with laws at the nodes, and at our quadrature points."""
    block = block_of(element=element, cells=cells, young_modulus=LOAD)
    face = LoadedFace.of_block(block, table.patches)
    return calculix.NodalFace(block, face.facets, table.patches), face


def pressed(face, laws, control, **crown):
    return LawContactProblem(face, laws, "pointwise", **crown).solve(control)


@long
@pytest.mark.parametrize("control", CONTROLS.values(), ids=CONTROLS)
@pytest.mark.parametrize("element", ["P1", "Q1"])
def test_same_mesh_same_table_same_answer(tmp_path, exported, element, control):
    table, path, lines = exported
    face, _ = faces_of(table, element, (6, 6, 4))
    found = calculix.solve(tmp_path, face, path, control)
    ours = pressed(face, lines, control)
    # seven digits are printed; iterations of both end at 1e-8 of the load
    assert found.force == pytest.approx(ours.force, rel=2e-6)
    assert found.reaction == pytest.approx(ours.force, rel=2e-6)
    moved = ours.displacement.reshape(-1, 3)
    np.testing.assert_allclose(found.displacement, moved, atol=1e-4 * np.abs(moved).max())
    assert len(found.pressure) == 49


@long
@pytest.mark.parametrize("control", CONTROLS.values(), ids=CONTROLS)
def test_force_and_pressures_are_within_the_interpolation_of_the_table(tmp_path, exported, control):
    table, path, _ = exported
    face, _ = faces_of(table, "Q1", (6, 6, 4))
    found = calculix.solve(tmp_path, face, path, control)
    ours = pressed(face, table.laws, control)
    assert found.force == pytest.approx(ours.force, rel=WITHIN)
    if table.patches.count > 1:
        return  # nodes between two patches have two pressures
    nodes = np.array(sorted(found.pressure))
    place = face.space.tabulate_dof_coordinates()[nodes, :2] - table.patches.middle
    sunk = ours.displacement.reshape(-1, 3)[nodes, 2]
    expected = table[0].pressure(control.approach + place @ np.array(control.tilt) + sunk)
    np.testing.assert_allclose([found.pressure[i] for i in nodes], expected, rtol=WITHIN)


@long
@pytest.mark.parametrize("element", ["P1", "Q1"])
def test_crowned_face_laws_at_nodes_and_at_quadrature_points_approach_each_other(
    tmp_path, exported, element
):
    table, path, _ = exported
    if table.patches.count > 1:
        pytest.skip("one law is enough for a rate")

    def crown(x, y):
        return 0.4 * APPROACH * ((2.0 * x - 1.0) ** 2 + 0.5 * (2.0 * y - 1.0) ** 2)

    control, differences = CONTROLS["tilted"], []
    for n in (4, 8):
        nodal, face = faces_of(table, element, (n, n, n))
        found = calculix.solve(tmp_path, nodal, path, control, crown=crown)
        ours = pressed(nodal, table.laws, control, crown=crown)
        assert found.force == pytest.approx(ours.force, rel=WITHIN)
        better = pressed(face, table.laws, control, crown=crown)
        differences.append(found.force / better.force - 1.0)
    # the trapezoidal rule errs by h²
    assert abs(differences[1]) < 0.02
    assert differences[0] / differences[1] == pytest.approx(4.0, abs=0.2)


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
