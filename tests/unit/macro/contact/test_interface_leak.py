"""What leaks over a face in a user's own problem: closed forms, directions, and what is refused."""

from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from dolfinx import fem
from helpers.faces import at as side
from helpers.user_problems import HEXAHEDRA, PATCHES, TETRAHEDRA, TOP, PowerLaw, box, marked

from patchlaw.geometry import Control, PatchGrid, Regions, RigidPlane
from patchlaw.macro import Interface, compat
from patchlaw.macro.contact.face_leak import LeakingFace, TriangleFace
from patchlaw.multiscale import LawTable, PatchLaw
from patchlaw.multiscale.laws.rows import LawRows, Transmissivity
from patchlaw.multiscale.laws.worn_laws import WornLaws
from patchlaw.support import InputError

LENGTHS = (1.5, 1.0, 1.0)
WATER = {"viscosity": 1e-9, "pressures": (0.4, 0.1)}
T = 3e-9, 1e-9


@dataclass(frozen=True)
class LeakingLaw(PowerLaw):
    """A law with a transmissivity of its own along x and y, to the closure's power."""

    power_of_leak: float = 0.0

    def transmissivities(self, closure):
        along, across = (np.full_like(closure, one) for one in T)
        return np.stack([along, across], axis=1) * (closure[:, None] / 1e-3) ** self.power_of_leak


def interface(cell=TETRAHEDRA, law=None, plane=None, **options):
    mesh = box(cells=(6, 4, 2), cell=cell, lengths=LENGTHS)
    space = compat.vector_space(mesh, 1)
    given = {"laws": law or LeakingLaw(1e3), "indenter": plane or RigidPlane(approach=1e-3)}
    found = Interface(space, marked(mesh, LENGTHS), TOP, **given, **options)
    found.evaluate(fem.Function(space))
    return mesh, found


@pytest.mark.parametrize("cell", [TETRAHEDRA, HEXAHEDRA])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_uniform_gap_leaks_as_plates_and_its_pressure_is_a_plane(cell, axis):
    mesh, found = interface(cell)
    first, second = side(mesh, axis, 0.0), side(mesh, axis, LENGTHS[axis])
    leak = found.leak(first, second, **WATER)
    expected = T[axis] * LENGTHS[1 - axis] / LENGTHS[axis] * 0.3 / 12e-9
    assert leak.rate == pytest.approx(expected, rel=1e-10)
    assert leak.imbalance < 1e-10 and leak.percolates
    points = leak.pressure.function_space.tabulate_dof_coordinates()
    on_face = np.isclose(points[:, 2], 0.0)
    plane = 0.4 - 0.3 * points[:, axis] / LENGTHS[axis]
    np.testing.assert_allclose(leak.pressure.x.array[on_face], plane[on_face], atol=1e-12)
    assert (leak.pressure.x.array[~on_face] == 0.0).all()
    back = found.leak(second, first, **WATER)
    assert back.rate == pytest.approx(expected, rel=1e-10)


def test_a_wedge_leaks_as_its_parts_in_series():
    """T = T₀ c³ of a closure that grows along the flow: ∫ dx/T across the face."""
    law = LeakingLaw(1e3, power_of_leak=3.0)
    plane = RigidPlane(approach=2e-3, tilt=(1e-3, 0.0))
    mesh, found = interface(HEXAHEDRA, law=law, plane=plane)
    leak = found.leak(side(mesh, 0, 0.0), side(mesh, 0, LENGTHS[0]), **WATER)
    closures = 2.0 + np.array([-0.75, 0.75])
    resistance = 0.5 * (closures[0] ** -2 - closures[1] ** -2)  # ∫ dc/c³, c in µm over mm
    # six elements of one transmissivity each let too much through, with the square of their size
    exact = T[0] / resistance
    assert leak.rate == pytest.approx(exact * 0.3 / 12e-9, rel=0.03)
    # that is what differs from harmonic means of facets, which are exact along the flow
    loaded = found._face
    values = law.transmissivities(found.closure)
    ends = side(mesh, 0, 0.0), side(mesh, 0, LENGTHS[0])
    face = LeakingFace(mesh, loaded.facets, loaded.quadrature, ends)
    harmonic = face.flow(values, harmonic=True).total
    assert harmonic == pytest.approx(exact, rel=2e-4)
    values[values[:, 0] < 1.001 * values[:, 0].min()] = 0.0  # points on a line across the flow
    assert face.flow(values, harmonic=True).total == 0.0 < face.flow(values).total


def test_patches_leak_in_parallel_and_in_series():
    """Patches of one law each, whose borders lie on those of the facets."""
    laws = [LeakingLaw(1e3, power_of_leak=p) for p in (0.0, 3.0, 0.0, 3.0)]
    mesh = box(cells=(4, 4, 2), cell=HEXAHEDRA)
    space = compat.vector_space(mesh, 1)
    plane = RigidPlane(approach=2e-3)
    found = Interface(space, marked(mesh), TOP, laws=laws, patches=PATCHES, indenter=plane)
    found.evaluate(fem.Function(space))
    rows = found.leak(side(mesh, 0, 0.0), side(mesh, 0, 1.0), **WATER).rate
    assert rows == pytest.approx(T[0] * 4.5 * 0.3 / 12e-9, rel=1e-9)  # 1 and 8 beside each other
    columns = found.leak(side(mesh, 1, 0.0), side(mesh, 1, 1.0), **WATER).rate
    assert columns == pytest.approx(T[1] / (0.5 + 0.5 / 8.0) * 0.3 / 12e-9, rel=1e-9)


@dataclass(frozen=True)
class PlacedLaw(LeakingLaw):
    """Its transmissivity along the first axis falls as the third power of the distance from it."""

    centre: tuple[float, float] = (0.0, 0.0)

    def transmissivities(self, closure, x):
        radius = np.hypot(*(x - self.centre).T)
        return T[0] * radius[:, None] ** -3.0 * [1.0, 0.5]


@pytest.mark.parametrize("cell", [TETRAHEDRA, HEXAHEDRA])
def test_lays_that_follow_a_ring(cell):
    """A sector of radii 4 to 5: T along the radius alone counts, uniform or over the radius."""
    mesh = box(cells=(6, 10, 1), cell=cell)
    radius, angle = 4.0 + mesh.geometry.x[:, 0], 0.8 * mesh.geometry.x[:, 1]
    inner, outer = side(mesh, 0, 0.0), side(mesh, 0, 1.0)
    top = side(mesh, 2, 0.0)
    axis = np.array([3.0, -2.0])
    mesh.geometry.x[:, 0] = axis[0] + radius * np.cos(angle)
    mesh.geometry.x[:, 1] = axis[1] + radius * np.sin(angle)
    space, middle = compat.vector_space(mesh, 1), (3.0, -2.0, 17.0)
    uniform, falling = 1.0 / np.log(5.0 / 4.0), 3.0 / (5.0**3 - 4.0**3)
    exact = {LeakingLaw: T[0] * 0.8 * uniform, PlacedLaw: T[0] * 0.8 * falling}
    for law, expected in exact.items():
        corner = {"centre": tuple(axis - mesh.geometry.x[:, :2].min(axis=0))}
        own = law(1e3, **corner) if law is PlacedLaw else law(1e3)
        found = Interface(space, None, top, laws=own, indenter=RigidPlane(approach=1e-3))
        found.evaluate(fem.Function(space))
        leak = found.leak(inner, outer, **WATER, axes="polar", centre=middle)
        # straight sides of elements 0.08 rad long, and 1/6 of the width
        assert leak.rate == pytest.approx(expected * 0.3 / 12e-9, rel=4e-3)
        about_middle = found.leak(inner, outer, **WATER, axes="polar").rate
        assert abs(about_middle / leak.rate - 1.0) > 0.1
    with pytest.raises(InputError, match="'centre' is that of polar axes"):
        found.leak(inner, outer, **WATER, centre=middle)
    with pytest.raises(InputError, match="axes = 'round'"):
        found.leak(inner, outer, **WATER, axes="round")


def test_what_drives_no_flow_is_refused():
    mesh, found = interface()
    ends = side(mesh, 0, 0.0), side(mesh, 0, LENGTHS[0])
    for options, text in (
        ({"viscosity": 0.0, "pressures": (1.0, 0.0)}, "viscosity = 0.0: must be greater than 0"),
        ({"viscosity": 1.0, "pressures": (1.0, 1.0)}, "pressures = .*drives no flow"),
    ):
        with pytest.raises(InputError, match=text):
            found.leak(*ends, **options)
    with pytest.raises(InputError, match="the outlet has no edge in common with the contact face"):
        found.leak(ends[0], side(mesh, 2, -LENGTHS[2]), **WATER)
    with pytest.raises(InputError, match="inlet and outlet touch each other"):
        found.leak(ends[0], side(mesh, 1, 0.0), **WATER)
    _, without = interface(law=PowerLaw(1e3))
    with pytest.raises(InputError, match=r"the law knows no leak.*leak=True"):
        without.leak(*ends, **WATER)
    small = PatchGrid(grid=(1, 1), lengths=(0.3, 0.3))
    space = found.space
    part = Interface(
        space, marked(mesh, LENGTHS), TOP, laws=[LeakingLaw(1e3)], patches=small,
        indenter=RigidPlane(approach=1e-3),
    )  # fmt: skip
    part.evaluate(fem.Function(space))
    with pytest.raises(InputError, match="a part of the contact face has no laws"):
        part.leak(*ends, **WATER)


class ClosureNamedX(LeakingLaw):
    """A law that calls its closure x."""

    def transmissivities(self, x):
        return super().transmissivities(x)


def test_laws_may_call_their_closure_x_or_not_tell():
    def rate(law, tell=None):
        mesh, found = interface(law=law)
        if tell is not None:
            law.transmissivities = tell(len(found.points))
        return found.leak(side(mesh, 0, 0.0), side(mesh, 0, LENGTHS[0]), **WATER).rate

    def untold(count):
        """Return a function that, like many of compiled modules, has no signature."""
        return partial(max, np.tile(T, (count, 1)), key=np.ndim)

    own = PowerLaw(1e3)
    bare = SimpleNamespace(pressure=own.pressure, stiffness=own.stiffness)
    expected = rate(LeakingLaw(1e3))
    assert rate(ClosureNamedX(1e3)) == expected
    assert rate(bare, untold) == pytest.approx(expected, rel=1e-12)  # of sums


def test_polar_axes_at_the_centre_have_the_length_of_others():
    corners = np.array([[[0.0, 0.0], [1.0, 0.0], [0.5, 1.5]]])
    ends = corners[0, :1], corners[0, 1:2]
    plain = TriangleFace(corners, *ends)
    polar = TriangleFace(corners, *ends, corners[0].mean(axis=0))
    lengths = [np.linalg.norm(face._gradient, axis=2) for face in (plain, polar)]
    np.testing.assert_allclose(*lengths, rtol=1e-12)


def test_a_face_that_has_run_in_leaks_through_its_worn_gaps():
    """Laws of two depths, with hydraulic gaps of 2 and 1 µm; a quarter of the way wears off."""
    separation, depth, wear = np.array([0.0, 1.0]), 4e-3, 1e-6

    def law(gap):
        ramp = np.linspace(0.0, 4e-3, 5)
        rows = LawRows(
            approach=ramp, closure=ramp, pressure=1e3 * ramp, contact_area_fraction=10.0 * ramp,
            contacts=np.arange(5), unresolved_displacement=0.0 * ramp, outside_range=ramp < 0.0,
        )  # fmt: skip
        gaps, none = np.full((2, 2), gap), np.zeros((2, 2))
        flow = Transmissivity(separation=separation, hydraulic_gap=gaps, on_half=gaps, scatter=none)
        known = {"first_touch": 0.0, "initial_separation": 5e-3, "transmissivity": flow}
        return PatchLaw(rows=rows, **known)

    worn = (WornLaws(depth=np.array([depth]), laws=(law(1e-3),)),)
    table = LawTable(patches=Regions(("top",)), laws=(law(2e-3),), made_by={}, worn=worn)
    mesh, found = interface(law=table, plane=Control(force=3.0), wear=wear)
    u = fem.Function(found.space)
    rates = []
    for slid in (0.0, 1e-3 / (2.0 * wear)):  # under 2 MPa
        if slid:
            found.slide(slid)
            found.evaluate(u)
            found.accept(u)
            found.evaluate(u)
        rates.append(found.leak(side(mesh, 0, 0.0), side(mesh, 0, 1.5), **WATER).rate)
    np.testing.assert_allclose(found.worn_depth, 0.25 * depth, rtol=1e-9)
    expected = np.array([2e-3, 1.75e-3]) ** 3 / 1.5 * 0.3 / 12e-9
    np.testing.assert_allclose(rates, expected, rtol=1e-9)
