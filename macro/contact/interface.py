"""A rough interface in a user's own dolfinx problem: residual and tangent of contact laws.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Real
from typing import Annotated, Any

import numpy as np
from petsc4py import PETSc

from patchlaw.geometry import Control, Friction, PatchGrid, RigidPlane, ShearControl
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.geometry.sliders import SliderRecord
from patchlaw.geometry.spring_bed import Coefficient
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces, ContactTangent, face_springs
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium, FaceShear
from patchlaw.macro.contact.face_laws import crown_depth
from patchlaw.macro.contact.face_leak import Axes, FaceLeak, LeakingFace, face_leak
from patchlaw.macro.contact.face_sliders import FaceSliders
from patchlaw.macro.contact.interface_parts import (
    Facets,
    MarkedFaces,
    check_in_plane,
    friction_or_wear,
    laws_by_zone,
    of_zones,
    prescribed_by,
)
from patchlaw.macro.contact.loaded_face import LoadedFace, Mode
from patchlaw.macro.linear_solvers.node_matrices import Displacements, free_unknowns
from patchlaw.macro.mesh.contact_face import point_field
from patchlaw.support import Array, Has, InputError, Positive, checked, real_array, together

FacetTags = Annotated[Any, Has("facet tags of dolfinx", ("indices", "values"))]
TaggedFacets = Annotated[Any, Has("an object with them, such as a TaggedMesh", ("facet_tags",))]


def _result(name: str, meaning: str) -> Any:
    """Return a property: a part of the latest state, read without communication."""
    return property(lambda interface: getattr(interface.state, name), doc=meaning)


class Interface:
    """Contact laws between a planar face of a body and a rigid plane, as a term of its equations.

    The body, its material and its supports are the user's; displacements are in mm and stresses in
    MPa, so that forces are in N. With the displacements u the closure at a point of the face is
    c = δ − g + n·u, with the approach δ of the plane, the macroscopic gap g and the normal n out of
    the body. The laws give the pressure p(c). The residual is −B p(c), where B p is the nodal load,
    to be added to internal less external forces.

    On a plane mesh the face is an edge or several in a line: forces, areas and shear forces are
    those of 1 mm across the plane, N per mm, or of whole circles where the mesh is axisymmetric, N;
    the face has the coordinate x along the edge, and the plane tilts and shifts along that alone.

    Args:
        space: The space of the displacements: continuous Lagrange of degree 1 or 2, three
            components, on tetrahedra or hexahedra, or two on triangles or quadrilaterals. Or the
            part ``W.sub(i)`` of a mixed space that the displacements are; vectors and matrices are
            then those of W.
        facet_tags: The facet tags of its mesh; or an object that has them as ``facet_tags`` beside
            names: a `TaggedMesh`, or what the newest dolfinx reads from gmsh. None where `tag` are
            the facets.
        tag: The face by number, by name, or as an array of this rank's facets or a mask of them;
            None where the laws are given by zone.
        laws: A table of laws per patch, such as a `LawTable`; one law for the whole face, such as
            a representative one; one law per patch beside `patches`; or the law of every zone of
            the face by its name or number, such as ``{"inner": one, "outer": other}``.
        indenter: Approach and tilt of the plane (`RigidPlane`), or what is prescribed of it
            (`Control`: a force, a free tilt); beside `opposite` how much closer the faces are than
            in the mesh, none by default. Both turn about the middle of the patches, a
            `RigidPlane` with a centre about that point, in coordinates of the face. It may be set
            anew for every load step.
        opposite: A second face of the same mesh in place of the plane, given like `tag`: of another
            volume, parallel, whose nodes need not match. The laws hold between both faces, where
            they lie opposite each other; their distance in the mesh is a gap.
        mode: ``"patchwise"``: the closure averaged over a patch gives one pressure for it, the
            default of laws per patch; ``"pointwise"``: a law holds at every quadrature point, the
            default of one law.
        patches: Patches in coordinates of the face; by default those of the table, in the middle
            of the face's bounding rectangle, or one patch on that rectangle.
        frame: Coordinates of the face; by default `FaceFrame.through`.
        bcs: Dirichlet conditions of the user's problem. What contact adds to the rows, and columns,
            that they constrain is left out. A `ContactProblem` hands in its own.
        crown: Depth of the face below its plane at points (x, y) of the plane, beside that of the
            mesh [mm]; None: none. Of laws by zone also that of every zone by its name.
        names: Number of every named face, where the tags know no names.
        friction: Coefficient of friction μ, or a `Friction`; None: none. Of laws by zone also that
            of every zone by its name. The plane shifts along the
            axes of the face as the indenter's ``Control(shear=ShearControl(shift=…))`` or
            ``ShearControl(force=…)`` says; without any it stays. What slips is remembered from load
            step to load step, see `accept`.
        wear: Depth that wears off the face per distance slid and pressure, by Archard's law
            [mm²/N]; None: none. Of laws by zone also that of every zone by its name. Faces wear
            where a load step slides, see `slide`; with friction by the slip of every sample, under
            the tractions of friction. Where a table of laws has those of worn surfaces, the
            roughness runs in.
        axisymmetric: Whether a plane mesh is turned about x = 0, so that x is the radius: weights
            have the factor 2 π x, which the user's forms then need too. Such a plane stays level,
            and is not sheared; of a face around the axis, a bore, `approach` is radial.

    Attributes:
        frame: Coordinates of the face.
        patches: The patches in them; of laws by zone the outline of the zones.
        mode: How the laws are evaluated.
        laws: One law per patch.
        opposite: The second face, as it was given; None: a plane presses.
        displacements: The displacements among the unknowns.
        marked: Facet tags whose marker 1 stands for the face.
        sampling: The samples that laws are evaluated at.
        forces: The forces of the laws, with the plane.

    Raises:
        InputError: On all ranks, when the space, the face, the laws or the patches do not fit.

    Note:
        Construction and all methods are collective, whether a rank owns facets or not. Results are
        those of the latest `evaluate`, and the same on every rank unless they say so.
    """

    force = _result("force", "Force on the face against its normal [N].")
    moment = _result("moment", "First moments of the pressures about the middle, (2,) [N mm].")
    area = _result("contact_area", "Real contact area [mm²]; None where a law does not know it.")
    patch_pressure = _result("patch_pressure", "Mean pressures of the patches, shape (N,) [MPa].")
    patch_closure = _result("patch_closure", "Mean closures of the patches, shape (N,) [mm].")
    closure = _result(
        "sample_closure", "Closures of this rank's samples, patches or points, (n,) [mm]."
    )
    pressure = _result("sample_pressure", "Pressures of this rank's samples, shape (n,) [MPa].")
    worn_depth = _result(
        "sample_worn_depth", "Depths worn off at this rank's samples, shape (n,) [mm]."
    )
    plane = _result("plane", "The plane, also where it follows from loads, about the middle.")

    @checked
    def __init__(
        self,
        space: compat.Space,
        facet_tags: FacetTags | TaggedFacets | None,
        tag: Facets | None = None,
        *,
        laws: Any,
        indenter: RigidPlane | Control | None = None,
        opposite: Facets | None = None,
        mode: Mode | None = None,
        patches: PatchGrid | None = None,
        frame: FaceFrame | None = None,
        bcs: Sequence[compat.Condition] = (),
        crown: Callable[[Array, Array], Array] | Mapping[Any, Any] | None = None,
        names: Mapping[str, Any] | None = None,
        friction: Coefficient | Friction | Mapping[Any, Any] | None = None,
        wear: Annotated[float, Positive] | Mapping[Any, Any] | None = None,
        axisymmetric: bool = False,
    ) -> None:
        running_in = None if wear is None else getattr(laws, "running_in", None)
        self.space, self.displacements = space, Displacements.of(space, axisymmetric=axisymmetric)
        self._faces = MarkedFaces(self.displacements, facet_tags, names)
        laws = laws_by_zone(laws) if tag is None else laws
        zones = list(laws) if tag is None else []
        self._crown = of_zones(crown, zones, "crown")
        self._friction, self._wear = friction_or_wear(friction, wear, zones)
        compat.collect_garbage(self.comm)  # of interfaces before this one
        found = self._faces.with_laws(tag, laws, opposite, mode, patches, frame)
        if indenter is None and opposite is None:
            raise InputError("nothing presses", key="indenter", allowed="RigidPlane or Control")
        self._face, self.laws, self.mode, self.marked = found
        self.frame, self.patches = self._face.facets.frame, self._face.patches
        self.opposite = opposite
        self._state: FaceEquilibrium | None = None
        self.forces = ContactForces(
            self._face, self.mode, running_in or self.laws, self._crown, self._friction
        )
        self.sampling = self.forces.sampling
        if wear is not None and friction is not None:
            self.forces.slip_wear = self._wear_of_samples
        self._check_laws()
        self._load = self.sampling.operator.createVecLeft()
        self.constrain(bcs)
        self.indenter = RigidPlane(approach=0.0) if indenter is None else indenter

    def _check_laws(self) -> None:
        """Refuse what is no law."""
        for evaluate in (self.forces.pressure, self.forces.stiffness):
            values = evaluate(-self.forces.gap)
            if not all(self.comm.allgather(bool(np.isfinite(values).all()))):
                raise InputError("the laws give values that are not finite")

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.space.mesh.comm

    @property
    def indenter(self) -> RigidPlane | Control:
        """The plane, or what is prescribed of it; without force it follows the displacements."""
        return self._indenter

    @indenter.setter
    def indenter(self, indenter: RigidPlane | Control) -> None:
        if not isinstance(indenter, RigidPlane | Control):
            raise InputError(
                "the indenter is no plane",
                value=indenter,
                allowed="RigidPlane(approach=…) or Control(force=…)",
            )
        if isinstance(indenter, Control) and indenter.shear and self._friction is None:
            raise InputError(
                "the plane shears an interface without friction",
                key="friction",
                value=str(indenter.shear),
                allowed="Interface(…, friction=0.3); or a Control without shear",
            )
        if self.displacements.dimension == 2:
            check_in_plane(indenter, turned=self.displacements.axisymmetric)
        self.forces.prescribe(prescribed_by(indenter, self.patches.middle), self.forces.plane)
        self._indenter, self._slides_from, self.forces.slides = indenter, None, False

    @property
    def assembles(self) -> bool:
        """Whether `add_tangent` gives the whole tangent: pointwise laws, the plane not free."""
        control = self.forces.control
        shifts = control.shear is not None and control.shear.force is not None
        alone = self.mode == "pointwise" and self.opposite is None
        return alone and not (control.free.any() or shifts)

    @property
    def quadrature_degree(self) -> int:
        """Polynomial degree that the quadrature on the face is exact for."""
        return self._face.quadrature_degree

    def crown_at(self, x: Array, y: Array) -> Array:
        """Return the depth of the crown at points of the plane, shapes (n,) [mm].

        Raises:
            InputError: When zones have crowns of their own.
        """
        if isinstance(self._crown, list):
            raise InputError(
                "every zone has a crown of its own", key="crown", allowed="one for all"
            )
        return crown_depth(self._crown, x, y)

    def approach_at(self, x: Array, y: Array) -> Array:
        """Return the approach of the plane as it is at points of it, shapes (n,) [mm]."""
        (approach, tx, ty), (xc, yc) = self.forces.plane, self.patches.middle
        return np.asarray(approach + tx * (x - xc) + ty * (y - yc))

    def constrain(self, bcs: Sequence[Any]) -> None:
        """Leave out what contact adds to unknowns that Dirichlet conditions constrain.

        Args:
            bcs: The conditions; none: nothing is left out.
        """
        self.forces.constrain(free_unknowns(bcs, self._load) if bcs else None)

    def make_room(self, matrix: PETSc.Mat) -> None:
        """Give a matrix of elasticity the entries that laws at points of two faces add."""
        if self.opposite is not None and self.mode == "pointwise":
            self.forces.make_room(matrix)

    def add_residual(self, x: Any, residual: PETSc.Vec) -> None:
        """Add −B p(c(u)) to a residual of internal less external forces [N].

        Args:
            x: Displacements, as a Function or a vector of PETSc [mm].
            residual: The residual, contributions of all ranks added; ghosts are left alone.
        """
        self.forces.write(self._vector(x), self._load, free=True)
        residual.axpy(-1.0, self._load)

    def add_tangent(self, x: Any, matrix: PETSc.Mat) -> None:
        """Add the derivative of `add_residual` to an assembled matrix of elasticity [N/mm].

        Its entries are those of nodes that share a facet, where such a matrix has entries already.

        Args:
            x: Displacements, as a Function or a vector of PETSc [mm].
            matrix: The matrix; assembled before and afterwards.

        Raises:
            InputError: Where the tangent has other entries: `tangent` serves there.
        """
        if not self.assembles:
            raise InputError(
                "the tangent couples all nodes of a patch, or of the face, and fits no matrix",
                value=f"mode {self.mode!r} under {self.forces.control}",
                allowed="pointwise laws of one face under a plane in a given place; else "
                "Interface.tangent",
            )
        self.move_tangent(x)
        forces = self.forces
        forces.add_springs(forces.slope if forces.sliders is None else forces.tangents, matrix)

    def tangent(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return a PETSc shell that applies a matrix plus the derivative of `add_residual`.

        It stands for the state last given to `move_tangent`, and for what the matrix holds when it
        is applied. It serves as long as the interface is kept.

        Args:
            matrix: The user's own tangent, such as the matrix of elasticity.
        """
        compat.collect_garbage(matrix.comm)  # an earlier shell holds its matrix until then
        return ContactTangent([self.forces]).shell(matrix)

    def move_tangent(self, x: Any) -> None:
        """Move the derivative to displacements, a Function or a vector of PETSc [mm]."""
        self.forces.update(self._vector(x))

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative with a vector x to y, as a shell does."""
        self.forces.add_product(x, y)

    def stiffness_matrix(self, x: Any, sliding: Any = None) -> PETSc.Mat:
        """Return the stiffness against small vibrations about displacements, to be added to K.

        Pressures follow the closures, dp/dc. With friction contacts stick, dp/dc over Mindlin's
        ratio; or all of them slide, and their shear stresses follow the pressures, so that the
        matrix is not symmetric. The plane stays where it is.

        Args:
            x: Displacements, as a Function or a vector of PETSc [mm].
            sliding: μ (tx, ty), the coefficient of friction times the direction in which the plane
                slides, along the axes of the face, shape (2,); or that of every law, (N, 2). None:
                nothing slides.

        Returns:
            An assembled matrix of the rows of the space [N/mm]; `natural_modes` leaves out what
            conditions hold.

        Raises:
            InputError: When `sliding` is not two numbers, or two of every law.
        """
        along, patch = None if sliding is None else real_array(sliding), self.forces.sampling.patch
        shapes = (2,), (self.forces.sampling.count, 2)
        if along is not None and not (along.shape in shapes and np.isfinite(along).all()):
            raise InputError(
                "is no direction on the face", key="sliding", value=sliding, allowed="μ (tx, ty)"
            )
        state = self.forces.state(self.forces.closure(self._vector(x)))
        if along is not None and along.ndim == 2:
            along = along[patch]
        tangents = self.forces.vibration_tangents(state, along)
        return face_springs(self._face, self.mode, tangents)

    def evaluate(self, x: Any) -> FaceEquilibrium:
        """Evaluate the contact at displacements; the properties then give its parts.

        Args:
            x: Displacements, as a Function or a vector of PETSc [mm].
        """
        vector = self._vector(x)
        closure = self.forces.closure(vector)
        shear = self.forces.shear_state(closure, vector)
        state = self.forces.state(closure, shear=shear)
        self._state = replace(state, contact_area=self._contact_area(state, state.sample_closure))
        return self._state

    @property
    def past(self) -> tuple[Any, FaceEquilibrium]:
        """What load steps left behind, and the latest contact; set it to go back to these."""
        return self.forces.past, self.state

    @past.setter
    def past(self, past: tuple[Any, FaceEquilibrium]) -> None:
        self.forces.past, self._state = past
        self._slides_from, self.forces.slides = None, False

    # --- wear

    def slide(self, distance: float) -> None:
        """Let the faces slide on each other during the load step to come, and wear.

        What wears off is the coefficient times the distance times the pressures at the end of the
        step (implicit Euler, of first order in the distance). `accept` ends the step. Of steps that
        `ContactProblem` chooses, `ContactProblem.slide` is made.

        With friction the plane shifts on by the distance, along its latest change, x to begin with,
        and every sample wears by its own slip. Shifts count from there afterwards.

        Args:
            distance: How far they slide [mm]; 0 takes an earlier one back.

        Raises:
            InputError: Without wear, or when it is no distance.
        """
        if self._wear is None:
            problem, allowed = "the interface does not wear", "Interface(…, wear=1e-8)"
            raise InputError(problem, key="wear", allowed=allowed)
        if not (isinstance(distance, Real) and 0.0 <= float(distance) < np.inf):
            raise InputError("is no distance", key="distance", value=distance, allowed=">= 0 mm")
        if (sliders := self.forces.sliders) is None:
            self.forces.wearing = float(distance) * self._wear_of_samples if distance else None
            return
        self.indenter = self.indenter  # takes an earlier distance back
        if distance:
            self._slides_from, self.forces.slides = sliders.memory.shift, True
            x, y = self._slides_from + float(distance) * sliders.memory.direction
            shifted = replace(self.forces.control, shear=ShearControl(shift=(float(x), float(y))))
            self.forces.prescribe(shifted, self.forces.plane)

    @property
    def _wear_of_samples(self) -> Array:
        """Coefficients of wear of this rank's samples, shape (n,) [mm²/N]."""
        each = np.broadcast_to(np.array(self._wear, float), self.sampling.count)
        return np.asarray(each[self.sampling.patch])

    @property
    def wears(self) -> bool:
        """Whether the interface wears where it slides."""
        return self._wear is not None

    @property
    def worn_volume(self) -> float:
        """Volume that has worn off at the latest `evaluate` [mm³]; collective."""
        return float(self.sampling.patch_sums(self.worn_depth).sum())

    @property
    def wear_record(self) -> Array:
        """Places and depths of what accepted load steps wore off, of all ranks, (m, 3) [mm].

        Set it to go on from there: to take load steps back, or in another run, on any number of
        ranks. Collective.

        Raises:
            InputError: When it is set, where it is that of another face.
        """
        return self.forces.record_of_wear

    @wear_record.setter
    def wear_record(self, record: Array) -> None:
        known = real_array(record)
        if known.ndim != 2 or known.shape[1] != 3:
            problem = "is no record of wear"
            raise InputError(problem, key="wear_record", allowed="an array of shape (m, 3) [mm]")
        self.forces.record_of_wear = known

    # --- friction

    def accept(self, x: Any) -> None:
        """Accept displacements as the end of a load step; later steps start from slip and wear.

        `ContactProblem` does so when it has converged. Solvers of your own do it once for every
        load step that counts; a step that is repeated or taken back starts from the last one that
        was accepted. Without friction and wear the order of load steps does not matter.

        Args:
            x: Displacements, as a Function or a vector of PETSc [mm].
        """
        if self.forces.sliders is not None or self.forces.wearing is not None:
            vector = self._vector(x)
            if self.forces.slip_wear is not None and self.forces.wearing is None:
                self.forces.wears_on(vector)  # the solver has not found by how much
            self.forces.accept(self.forces.closure(vector), vector)
            if (start := self._slides_from) is not None:
                self._sliders.count_from(start, self.forces.along(vector))
                self.indenter, state = self.indenter, self.state
                slip, (sx, sy) = self._sliders.memory.sliders.slip, map(float, start)
                shear = self._sheared()._replace(shift=(sx, sy), sample_slip=slip)
                self._state = replace(state, shear=shear)

    @property
    def slip_record(self) -> SliderRecord:
        """Slip after the accepted load steps, for any number of ranks.

        Set it to go on from there: to take load steps back, or in another run.

        Raises:
            InputError: Without friction; when it is set, where it is that of another face.
        """
        return self._sliders.record()

    @slip_record.setter
    def slip_record(self, record: SliderRecord) -> None:
        self._sliders.restore(record)

    @property
    def shear_force(self) -> Array:
        """Shear force on the plane along the axes of the face, shape (2,) [N]."""
        return np.array(self._sheared().force)

    @property
    def shear_force_error(self) -> float:
        """Error of the shear force by the springs of the laws, on any path [N]; collective.

        It is that of the shear stresses at their slips; a soft body leaves less of it.
        """
        bound = self._sliders.coefficient * np.maximum(self.pressure, 0.0)
        return float(self._sliders.total((self._sliders.path_error * bound)[:, None])[0])

    @property
    def shift(self) -> Array:
        """Shift of the plane along the axes of the face, shape (2,) [mm]."""
        return np.array(self._sheared().shift)

    @property
    def shear_stress(self) -> Array:
        """Shear stresses on the body at this rank's samples, shape (n, 2) [MPa]."""
        return self._sheared().sample_stress

    @property
    def dissipated(self) -> float:
        """Energy lost to friction since the start [N mm]."""
        return self._sheared().dissipated

    @property
    def slip_area(self) -> float | None:
        """Real contact area that slips [mm²]; None where a law does not know its area; collective.

        What sticks is the area of the law at the closure where it is as stiff as what sticks.
        """
        self._sheared()
        sticks = self._contact_area(self.state, self.forces.sticking(self.state))
        return None if sticks is None or self.area is None else self.area - sticks

    def _sheared(self) -> FaceShear:
        assert self._sliders is not None and self.state.shear is not None
        return self.state.shear

    @property
    def _sliders(self) -> FaceSliders:
        if self.forces.sliders is None:
            raise InputError("the interface has no friction", key="friction", allowed="a number")
        return self.forces.sliders

    @property
    def state(self) -> FaceEquilibrium:
        """The contact at the latest `evaluate`.

        Raises:
            InputError: Before that.
        """
        if self._state is None:
            raise InputError("nothing is solved or evaluated on this interface yet")
        return self._state

    def _contact_area(self, state: FaceEquilibrium, closure: Array) -> float | None:
        """Return the contact area; None without ``at`` of a law."""
        if not self._laws.know("at"):
            return None
        share = self._read_off("contact_area_fraction", state, closure)
        return float(self.sampling.patch_sums(share).sum())

    def _read_off(self, name: str, state: FaceEquilibrium, closure: Array) -> Array:
        """Return what laws give at closures of this rank's samples, on tangents beyond tables."""
        at = self.sampling.patch, closure, state.sample_worn_depth
        return together(self.comm, partial(self._laws.read_off, name, *at))

    @property
    def _laws(self) -> Any:
        """The laws, evaluated together."""
        return self.forces.laws

    def fields(self) -> dict[str, Any]:
        """Return the contact at the latest `evaluate` as functions on the mesh, for files.

        They are linear between the vertices of the mesh: means of the samples around every vertex
        of the face, and 0 elsewhere. Files take them together, as ``VTXWriter(comm, "face.bp",
        [*interface.fields().values()]).write(0.0)``.

        Returns:
            By name, which the functions have too, ``pressure`` [MPa], ``closure`` [mm] and
            ``stiffness`` [MPa/mm] of the laws; ``gap``, the mean gap between the plane and the
            rough face, of laws that know it [mm]; with friction ``slip_x`` and ``slip_y`` of the
            plane along the axes of the face, beyond the displacement of the body; on a plane mesh
            the first alone [mm].
        """
        state, forces, points = self.state, self.forces, self._face.quadrature
        closure = state.sample_closure
        known: dict[str, Array] = {
            "pressure": state.sample_pressure,
            "closure": closure,
            "stiffness": forces.law_stiffness(state),
        }
        if self._laws.know("initial_separation"):
            known["gap"] = self._read_off("separation", state, closure)
        if state.shear is not None:
            names = ("slip_x", "slip_y")[: self.displacements.dimension - 1]
            known |= dict(zip(names, state.shear.sample_slip.T, strict=False))
        if self.wears:
            known["worn_depth"] = state.sample_worn_depth
        return {
            name: point_field(
                self.space.mesh,
                name,
                points,
                values
                if self.mode == "pointwise"
                else (self.sampling.patch_sums(values) / self._face.areas)[points.patch],
            )
            for name, values in known.items()
        }

    def check_range(self) -> None:
        """Refuse closures of the latest `evaluate` beyond the tables of the laws.

        Laws are continued by their tangents there. Laws without ``at`` have no range.

        Raises:
            InputError: With the largest closure and the range of that law.
        """
        at = self.sampling.patch, self.closure, self.worn_depth
        together(self.comm, partial(self._laws.check_range, *at))

    @checked
    def leak(
        self,
        inlet: Facets,
        outlet: Facets,
        *,
        viscosity: Annotated[float, Positive],
        pressures: tuple[float, float],
        axes: Axes = "x",
        centre: tuple[float, float, float] | None = None,
    ) -> FaceLeak:
        """Return what leaks over the face at the latest `evaluate`, from edge to edge.

        Reynolds' equation on the face with the transmissivity of its laws, which have it where they
        were made with ``leak=True``. Other edges are walls. Fluid pressure does not move the face.

        Args:
            inlet: The face of the body, as `tag`, that shares with the contact face the edge where
                the fluid enters.
            outlet: That where it leaves.
            viscosity: Dynamic viscosity of the fluid [MPa s]; that of water is 1e-9.
            pressures: Fluid pressures at inlet and outlet [MPa].
            axes: Whether the transmissivities of the laws lie along the axes x and y of the face,
                or, as those of turned faces do, along the radius and around a centre: ``"polar"``.
            centre: A point on the axis around which they then turn, in coordinates of the mesh
                [mm]; by default the middle of the face's bounding rectangle.

        Returns:
            Flow rate, balance, and the fluid pressure as a function on the mesh. With laws per
            patch the transmissivity is uniform on every patch.

        Raises:
            InputError: When a law has no ``transmissivities``, the patches do not cover the face,
                or inlet and outlet do not share an edge with it.
            NotConverged: When what enters and leaves the nodes of the mesh does not balance.
        """
        if self.displacements.dimension == 2:
            raise InputError("over the edges of a plane mesh no leak is known", key="space")
        if not isinstance(self._face, LoadedFace):
            raise InputError("between two faces of a mesh no leak is known", key="opposite")
        mesh, points = self.space.mesh, self._face.quadrature
        if centre is not None and axes != "polar":
            raise InputError("'centre' is that of polar axes", allowed="axes='polar' beside it")
        given = {"inlet": inlet, "outlet": outlet}
        inside, outside = (self._faces.find(one, key)[0] for key, one in given.items())
        patch, places = points.patch, np.column_stack((points.x, points.y))
        closure, depth = self.closure, self.worn_depth
        if self.mode == "patchwise":
            closure = self.state.patch_closure[patch]
            depth = (self.sampling.patch_sums(depth) / self._face.areas)[patch]
        at = patch, closure, depth, places
        values = together(self.comm, partial(self._laws.transmissivities, *at))
        facets, ends = self._face.facets, (inside, outside)
        face = LeakingFace(mesh, facets, points, ends, axes=axes, centre=centre)
        return face_leak(face, values, viscosity, pressures)

    @property
    def points(self) -> Array:
        """Places of this rank's samples in coordinates of the face, shape (n, 2) [mm]."""
        return self.sampling.places

    def _vector(self, x: Any) -> PETSc.Vec:
        """Return displacements as a vector of PETSc."""
        vector = compat.petsc_vector(x) if hasattr(x, "function_space") else x
        if vector.getSizes() != self._load.getSizes():
            raise InputError(
                "the displacements are those of another space",
                value=vector.getSize(),
                allowed=f"{self._load.getSize()} unknowns",
            )
        return vector
