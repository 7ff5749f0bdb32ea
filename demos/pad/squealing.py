"""The pad of the demo on squeal, as any user of dolfinx writes it, and its picture."""

import mpi4py.MPI  # noqa: F401  # isort: skip  (its library is loaded before dolfinx)
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.fem.petsc import assemble_matrix

from patchlaw import vector_space
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    FULL_WIDTH,
    ORANGE,
    logarithmic,
    panels,
    use_style,
)

LENGTHS, DEPTH = (90.0, 45.0), (15.0, 10.0)  # of the face; lining and its back plate below [mm]
LINING, PLATE = (3000.0, 0.25, 2.5e-9), (210e3, 0.3, 7.85e-9)  # E [MPa], ν, density [t/mm³]


class Pad:
    """A pad guided on its back, and at its ends along the face, where friction drives it to one.

    Args:
        comm: MPI communicator.
        cells: Cells along x, y and z, of which the third ones lie in the lining.
    """

    def __init__(self, comm, cells):
        corners = [np.array([0.0, 0.0, -sum(DEPTH)]), np.array([*LENGTHS, 0.0])]
        mesh = dmesh.create_box(comm, corners, list(cells), dmesh.CellType.hexahedron)
        self.space = vector_space(mesh, 2)
        self.u = fem.Function(self.space)
        self.top = dmesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], 0.0))
        inside = ufl.gt(ufl.SpatialCoordinate(mesh)[2], -DEPTH[0])
        pairs = zip(LINING, PLATE, strict=True)
        young, nu, density = (ufl.conditional(inside, *pair) for pair in pairs)
        self._lame = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
        v, w = ufl.TestFunction(self.space), ufl.TrialFunction(self.space)
        self._dx = ufl.dx(metadata={"quadrature_degree": 4})
        forms = self.inner(w), density * ufl.inner(w, v) * self._dx
        self.stiffness, self.mass = (assemble_matrix(fem.form(form)) for form in forms)
        self.stiffness.assemble()
        self.mass.assemble()
        plate = DEPTH[0] - 1e-6
        self.bcs = [
            self._held(2, lambda x: np.isclose(x[2], -sum(DEPTH))),
            self._held(0, lambda x: np.isclose(x[0], LENGTHS[0])),
            self._held(1, lambda x: np.isclose(x[0] % LENGTHS[0], 0.0) & (x[2] < -plate)),
        ]

    def inner(self, displacement):
        """Return the inner virtual work."""
        strain, (lame, shear) = ufl.sym(ufl.grad(displacement)), self._lame
        stress = lame * ufl.tr(strain) * ufl.Identity(3) + 2 * shear * strain
        return ufl.inner(stress, ufl.grad(ufl.TestFunction(self.space))) * self._dx

    def _held(self, axis, where):
        part = self.space.sub(axis), self.space.sub(axis).collapse()[0]
        nodes = fem.locate_dofs_geometrical(part, where)
        return fem.dirichletbc(fem.Function(part[1]), nodes, part[0])


def draw(path, pressures, curves, merges, frictions, swept, least):
    """Draw frequencies over pressure and over friction, and where modes merge."""
    use_style()
    figure, (left, middle, right) = panels(1, 3, 2.6, width=FULL_WIDTH)
    left.plot(pressures, np.array(curves)[:, :6], "o-", color=BLUE, markersize=3)
    left.set(xscale="log", xlabel="brake pressure [MPa]", ylabel="frequency [kHz]")
    for friction, found in zip(frictions, swept, strict=True):
        grows = found.damping < -1.0
        for chosen, colour in ((~grows, BLUE), (grows, ORANGE)):
            shown = found.frequencies[chosen] / 1e3
            middle.plot(np.full(len(shown), friction), shown, "o", color=colour, markersize=3)
    middle.set(xlabel="coefficient of friction", ylabel="frequency [kHz]")
    middle.set_title(f"{pressures[-1]:g} MPa; orange: grows")
    right.plot(pressures, [friction for friction, _ in merges], "o-", color=BLUE)
    right.plot(np.full(len(least), pressures[-1]), least, "_", color=ORANGE, ms=8.0)
    right.set(xscale="log", xlabel="brake pressure [MPa]", ylabel="friction at which modes merge")
    right.set_title(f"dashes: {len(least)} pads")
    left.set_title("without friction")
    for axes in (left, right):
        logarithmic(axes.xaxis)
    low, high = (f"μ = {merges[one][0]:.2f} under {pressures[one]:g} MPa" for one in (0, -2))
    figure.savefig(path, dpi=200, metadata={"answer": f"at {low}, at {high}"})
