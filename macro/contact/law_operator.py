"""Laws of an interface as an external operator of UFL, by the package dolfinx-external-operator.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from patchlaw.geometry import PatchGrid
from patchlaw.macro import compat
from patchlaw.macro.contact.interface import Interface
from patchlaw.macro.mesh.facets import facet_nodes
from patchlaw.support import Array, InputError, Locals, checked

PACKAGE = "dolfinx_external_operator"


def _check_known(interface: Interface) -> None:
    """Refuse interfaces that an external operator does not know.

    Raises:
        InputError: With what serves them.
    """
    displacements = interface.displacements
    other_space = displacements.dimension == 2 or displacements.taken is not None
    for unknown, problem, key in (
        (other_space, "knows displacements alone, on meshes of three dimensions", "space"),
        (interface.mode != "pointwise", "holds at points", "mode"),
        (interface.forces.sliders is not None, "knows pressures alone", "friction"),
        (interface.wears, "knows no wear", "wear"),
        (interface.opposite is not None, "knows the displacements of one face alone", "opposite"),
        (not isinstance(interface.patches, PatchGrid), "knows no laws by zone", "laws"),
    ):
        if unknown:
            raise InputError(
                f"an external operator {problem}",
                key=key,
                value=interface.opposite if key == "opposite" else None,
                allowed="another interface; or Interface.add_residual and ContactProblem",
            )


class LawsAtPoints:
    """Pressures of an interface as functions of n·u at given points of its face.

    They follow the interface's indenter as it is when they are called. The normal n points out of
    the body; off the patches there is no pressure.

    Args:
        interface: The interface; it must be pointwise, and its plane in a given place.
        points: The points, shape (m, q, 3): q on each of m facets [mm].

    Raises:
        InputError: When the interface is patchwise, has friction, wears, or is between two faces.
    """

    def __init__(self, interface: Interface, points: Array) -> None:
        _check_known(interface)
        self._interface = interface
        self._shape = np.shape(points)[:2]
        flat = np.reshape(points, (-1, 3))
        places = interface.frame.in_plane(flat)
        self._x, self._y = places.T
        patches: Any = interface.patches
        lower = np.array(patches.origin)
        self._inside = np.all((places >= lower) & (places <= lower + patches.lengths), axis=1)
        self._patch = np.zeros(len(flat), dtype=np.intp)
        self._patch[self._inside] = patches.index_of(*places[self._inside].T)
        self._gap = interface.crown_at(self._x, self._y) - interface.frame.height(flat)

    def external_function(self, derivatives: tuple[int, ...]) -> Callable[[Array], Array]:
        """Return the pressure, or its derivative, as the package asks for it.

        Args:
            derivatives: (0,) for p [MPa], (1,) for dp/d(n·u) [MPa/mm].

        Returns:
            A function of n·u at the points, shape (m, q) [mm]; its values have shape (m q,).

        Raises:
            InputError: When it is another derivative.
        """
        if derivatives not in ((0,), (1,)):
            raise InputError("no such derivative", value=derivatives, allowed="(0,), (1,)")
        name = "stiffness" if derivatives == (1,) else "pressure"
        return lambda outward: self._values(name, np.asarray(outward, dtype=np.float64))

    def _values(self, name: str, outward: Array) -> Array:
        interface = self._interface
        if interface.forces.control.free.any():
            raise InputError(
                "an external operator needs the plane in its place",
                value=str(interface.forces.control),
                allowed="RigidPlane(approach=…)",
            )
        closure = interface.approach_at(self._x, self._y) - self._gap + outward.ravel()
        values = np.zeros(len(closure))
        for i in np.unique(self._patch[self._inside]):
            part = self._inside & (self._patch == i)
            values[part] = getattr(interface.laws[i], name)(closure[part])
        return values


class LawOperator:
    """An interface as a term of UFL: p n·v over the face, with p an external operator of n·u.

    Add ``operator.pressure * ufl.inner(operator.normal, v) * operator.measure`` to the residual,
    hand form and derivative to the package's ``replace_external_operators``, compile them with
    ``entity_maps=operator.entity_maps``, and evaluate operands with
    ``entities=operator.entities`` before every assembly.

    Args:
        interface: The interface, pointwise.
        displacement: u, a Function in its space.
        degree: Degree of the quadrature on the facets, which patches' borders do not cut; None:
            that of the interface.

    Attributes:
        pressure: p, a ``FEMExternalOperator``.
        normal: n, out of the body, as UFL.
        measure: The measure on the face.
        entity_maps: For ``dolfinx.fem.form``.
        entities: Cell and local facet of every facet, shape (m, 2).

    Raises:
        InputError: Without the package, or on a dolfinx that it does not serve.

    Note:
        Construction is collective. Import the package before the first form is made: UFL counts
        its types, to which the package adds one.
    """

    @checked
    def __init__(
        self,
        interface: Interface,
        displacement: compat.Displacement,
        degree: compat.Degree | None = None,
    ) -> None:
        _check_known(interface)
        try:
            package = import_module(PACKAGE)
        except ImportError as error:
            raise InputError(
                f"external operators need the package dolfinx-external-operator ({error}), which "
                "pip installs beside any dolfinx with --no-deps; Interface.add_residual and "
                "ContactProblem do without it"
            ) from error
        if not hasattr(dmesh, "EntityMap"):
            raise InputError(
                "external operators on a face need dolfinx 0.10 or newer; Interface.add_residual "
                "and ContactProblem do without them"
            )
        mesh, facets = interface.space.mesh, interface.marked.find(1)
        degree = interface.quadrature_degree if degree is None else degree
        surface, mapped, *_ = dmesh.create_submesh(mesh, 2, facets)
        self.entities = _cell_facets(mesh, surface, mapped)
        elements = import_module("basix.ufl")  # not there with the oldest dolfinx
        element = elements.quadrature_element(surface.basix_cell(), value_shape=(), degree=degree)
        space = fem.functionspace(surface, element)
        self.laws = LawsAtPoints(interface, self._points(mesh, space))
        self.normal = ufl.as_vector(interface.frame.normal.tolist())
        self.entity_maps = [mapped]
        self.measure = ufl.Measure(
            "ds",
            domain=mesh,
            subdomain_data=interface.marked,
            subdomain_id=1,
            metadata={"quadrature_degree": degree},
        )
        self.pressure = package.FEMExternalOperator(
            ufl.inner(self.normal, displacement),
            function_space=space,
            external_function=self.laws.external_function,
        )

    def _points(self, mesh: Any, space: Any) -> Array:
        """Return the quadrature points on all facets, shape (m, q, 3) [mm]."""
        local = space.element.interpolation_points
        if not len(self.entities):
            return np.empty((0, len(local), 3))
        place = fem.Expression(ufl.SpatialCoordinate(mesh), local)
        return np.reshape(place.eval(mesh, self.entities), (len(self.entities), len(local), 3))


def _cell_facets(mesh: Any, surface: Any, mapped: Any) -> Locals:
    """Return the cell and the local facet in it of every cell of a surface, shape (m, 2)."""
    cells = surface.topology.index_map(2)
    own = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    nodes = facet_nodes(mesh, mapped.sub_topology_to_topology(own, False))
    return np.column_stack((nodes.cell, nodes.side)).astype(np.int32)
