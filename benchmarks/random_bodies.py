"""Bodies under laws, drawn at random: shapes, cells, elements, laws and controls.

Outlines in the plane of x and z are extruded along y: a plate on two feet, a wide base with a foot
whose end is the contact face, a pad of two materials, a wedge. A quarter of a ring stands on
rollers. The support is the lowest plane, the contact face the highest.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from helpers.mesh_files import gmsh_session

from patchlaw.geometry import Control
from patchlaw.geometry.meshes.gmsh_file import MeshArrays, read_gmsh_file
from patchlaw.macro import (
    LawContactProblem,
    LoadedFace,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    contact_facets,
    planar_face,
)
from patchlaw.macro.compat import mesh_from_cells
from patchlaw.macro.mesh.from_file import refined
from patchlaw.macro.mesh.tagged import cell_tags, facet_tags
from patchlaw.multiscale import Scene
from patchlaw.multiscale.models.measured_errors.faces import LawErrorProbe

SHAPES = "feet", "foot", "pad", "ring", "wedge"
FACES = {"support": 1, "contact": 2, "x": 3, "y": 4}
_SLACK = 1e-6


class Exponential:
    """p = a (exp(c / s) − 1)."""

    def __init__(self, pressure, length):
        self._pressure, self._length = pressure, length

    def pressure(self, closure):
        return self._pressure * np.expm1(np.clip(closure / self._length, 0.0, 60.0))

    def stiffness(self, closure):
        grown = np.exp(np.clip(closure / self._length, 0.0, 60.0))
        return np.where(closure > 0.0, self._pressure * grown / self._length, 0.0)


class Power:
    """p = k c^m."""

    def __init__(self, factor, power):
        self._factor, self._power = factor, power

    def pressure(self, closure):
        return self._factor * np.maximum(closure, 0.0) ** self._power

    def stiffness(self, closure):
        return self._factor * self._power * np.maximum(closure, 0.0) ** (self._power - 1.0)


@dataclass(frozen=True, kw_only=True)
class RandomBody:
    """A body and its load.

    Args:
        shape: One of `SHAPES`.
        hexahedra: Whether its cells are hexahedra.
        order: Degree of the displacements.
        size: Length of the cells [mm].
        length: A length of the shape, and further ones relative to it, shape (4,).
        materials: Of the volumes, from the support up.
        law: The law of the whole face.
        pressure: Mean pressure of the load [MPa].
        tilt: Slopes of the plane; None: free to turn.
    """

    shape: str
    hexahedra: bool
    order: int
    size: float
    length: float
    ratios: tuple[float, ...]
    materials: tuple[Material, Material]
    law: object
    pressure: float
    tilt: tuple[float, float] | None

    @property
    def name(self):
        """What it is, in short."""
        cells = f"{'Q' if self.hexahedra else 'P'}{self.order}"
        turns = "free" if self.tilt is None else "held" if any(self.tilt) else "level"
        return f"{self.shape}, {cells}, {type(self.law).__name__.lower()} law, {turns}"


_CELLS = {"P1": (3.0, 7.0), "Q1": (5.0, 10.0), "P2": (2.0, 4.0), "Q2": (3.0, 6.0)}
"""Cells along the length of a body, at least and at most: 300 to 8000 unknowns."""


def drawn(seed, *, coarser=1.0):
    """Return a random body; shapes follow in turn.

    Args:
        seed: Its number.
        coarser: How many times as long its cells are.
    """
    rng = np.random.default_rng([31, seed])
    length = float(rng.uniform(8.0, 40.0))
    modulus = float(np.exp(rng.uniform(np.log(2e3), np.log(210e3))))
    pressure = float(np.exp(rng.uniform(np.log(0.3), np.log(15.0)))) * modulus / 2e5
    # roughness over what the body gives way by, from stiff to soft laws
    closure = float(np.exp(rng.uniform(np.log(0.01), np.log(1.0)))) * pressure / modulus * length
    law = (
        Exponential(pressure / np.expm1(5.0), closure / 5.0)
        if rng.random() < 0.6
        else Power(pressure / closure ** (power := float(rng.uniform(1.0, 3.0))), power)
    )
    # held ones lift a part of some faces off the plane
    tilts = (0.0, 0.0), tuple(rng.uniform(-2.0, 2.0, 2) * pressure / modulus), None
    hexahedra, order = bool(rng.random() < 0.5), int(rng.integers(1, 3))
    cells = float(rng.uniform(*_CELLS[f"{'Q' if hexahedra else 'P'}{order}"]))
    return RandomBody(
        shape=SHAPES[seed % len(SHAPES)],
        hexahedra=hexahedra,
        order=order,
        size=coarser * length / cells,
        length=length,
        ratios=tuple(map(float, rng.uniform(0.25, 0.75, 4))),
        materials=(
            Material(young_modulus=modulus, poisson_ratio=float(rng.uniform(0.0, 0.4))),
            Material(
                young_modulus=modulus * float(np.exp(rng.uniform(-2.0, 0.0))),
                poisson_ratio=float(rng.uniform(0.0, 0.4)),
            ),
        ),
        law=law,
        pressure=pressure,
        tilt=tilts[int(rng.integers(3))],
    )


def arrays_of(body):
    """Return its mesh as arrays; call it on one rank."""
    sections, height = _sections(body)
    return _hexahedra(body, sections, height) if body.hexahedra else _tetrahedra(
        body, sections, height
    )  # fmt: skip


def _sections(body):
    """Return quadrilaterals that a section consists of, row by row, and the height of the top.

    A section is a lattice of corners, shape (columns + 1, rows + 1, 2), in which some
    quadrilaterals have a volume, shape (columns, rows): its number from 1 on, or 0 for none.
    """
    a, (r, s, t, _) = body.length, body.ratios
    h = a * (0.5 + s)
    if body.shape == "ring":  # radii and angles
        radii, angles = [a * (1.0 - 0.6 * r), a], [0.0, 0.5 * np.pi]
        return (_lattice(radii, angles), np.ones((1, 1), int)), a * 0.6 * s
    if body.shape == "feet":
        volumes = np.array([[1, 1], [0, 1], [1, 1]])
        return (_lattice([0, 0.4 * r * a, a - 0.4 * t * a, a], [0, s * h, h]), volumes), h
    if body.shape == "foot":
        volumes = np.array([[1, 0], [1, 1], [1, 0]])
        return (_lattice([0, 0.5 * r * a, a - 0.5 * t * a, a], [0, 0.6 * h, h]), volumes), h
    if body.shape == "pad":
        return (_lattice([0, a], [0, r * h, h]), np.array([[1, 2]])), h
    corners = [[(0, 0), (0.3 * t * a, h)], [(a, 0), (a * (0.5 + r), h)]]
    return (np.array(corners, float), np.ones((1, 1), int)), h


def _lattice(x, z):
    return np.stack(np.meshgrid(x, z, indexing="ij"), axis=2).astype(float)


def _hexahedra(body, section, height):
    """Return a lattice of hexahedra, without the parts that have no volume."""
    corners, volumes = section
    depth = height if body.shape == "ring" else body.length * body.ratios[3]
    spans = [np.linalg.norm(np.diff(corners, axis=k), axis=2).max(axis=1 - k) for k in (0, 1)]
    if body.shape == "ring":
        spans[1] = spans[1] * body.length
    counts = [np.maximum(np.round(span / body.size).astype(int), 2) for span in spans]
    layers = max(2, round(depth / body.size))
    u, v = (np.concatenate([k + np.arange(n) / n for k, n in enumerate(c)] + [[len(c)]])
            for c in counts)  # fmt: skip
    flat = _between(corners, *np.meshgrid(u, v, indexing="ij"))
    if body.shape == "ring":
        flat = np.stack([flat[..., 0] * np.cos(flat[..., 1]), flat[..., 0] * np.sin(flat[..., 1])],
                        axis=2)  # fmt: skip
    along = np.linspace(0.0, depth, layers + 1)
    points = np.concatenate(
        [np.broadcast_to(flat[:, :, None], (*flat.shape[:2], layers + 1, 2)),
         np.broadcast_to(along[:, None], (*flat.shape[:2], layers + 1, 1))], axis=3
    )  # fmt: skip
    order = [0, 1, 2] if body.shape == "ring" else [0, 2, 1]  # x and y, or x and z, in the section
    points = points[..., order].reshape(-1, 3)
    number = np.arange(len(points)).reshape(len(u), len(v), layers + 1)
    where = volumes[np.repeat(np.arange(len(counts[0])), counts[0])]
    where = where[:, np.repeat(np.arange(len(counts[1])), counts[1])]
    tags = np.repeat(where[:, :, None], layers, axis=2)
    cells = np.stack(
        [number[i : len(u) - 1 + i, j : len(v) - 1 + j, k : layers + k]
         for k in (0, 1) for j in (0, 1) for i in (0, 1)], axis=3
    )[tags > 0]  # fmt: skip
    used, cells = np.unique(cells, return_inverse=True)
    cells, points = cells.reshape(-1, 8), points[used]
    sides = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    quads = cells[:, sides].reshape(-1, 4)
    facets, facet_tags = [], []
    for name, axis, place in _surfaces(height):
        on = np.all(np.abs(points[quads, axis] - place) < _SLACK, axis=1)
        facets.append(quads[on])
        facet_tags.append(np.full(int(on.sum()), FACES[name], np.int32))
    return MeshArrays(
        points=points,
        cells=cells,
        cell_tags=tags[tags > 0].astype(np.int32),
        facets=np.concatenate(facets),
        facet_tags=np.concatenate(facet_tags),
        cell_names={str(number): int(number) for number in np.unique(tags[tags > 0])},
        facet_names=FACES,
    )


def _between(corners, u, v):
    """Return points of a lattice of corners at bilinear coordinates."""
    i, j = (np.minimum(w.astype(int), n - 2) for w, n in zip((u, v), corners.shape, strict=False))
    s, t = (u - i)[..., None], (v - j)[..., None]
    low = (1 - s) * corners[i, j] + s * corners[i + 1, j]
    return (1 - t) * low + t * ((1 - s) * corners[i, j + 1] + s * corners[i + 1, j + 1])


def _surfaces(height):
    return [("support", 2, 0.0), ("contact", 2, height), ("x", 0, 0.0), ("y", 1, 0.0)]


def _tetrahedra(body, section, height):
    """Return a mesh of tetrahedra by gmsh."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "body.msh"
        with gmsh_session(body.shape) as gmsh:
            volumes = _volumes(gmsh.model.occ, body, section)
            gmsh.model.occ.synchronize()
            if body.shape == "pad":
                for number, volume in enumerate(volumes, start=1):
                    gmsh.model.addPhysicalGroup(3, [volume], number)
            else:
                gmsh.model.addPhysicalGroup(3, volumes, 1)
            for name, axis, place in _surfaces(height):
                box = np.array([[-1e3] * 3, [1e3] * 3])
                box[:, axis] = place - _SLACK, place + _SLACK
                found = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*box.ravel(), 2)]
                if found:
                    gmsh.model.addPhysicalGroup(2, found, FACES[name])
                    gmsh.model.setPhysicalName(2, FACES[name], name)
            for option in ("MeshSizeMax", "MeshSizeMin"):
                gmsh.option.setNumber(f"Mesh.{option}", body.size)
            gmsh.option.setNumber("Mesh.Binary", 1)
            gmsh.model.mesh.generate(3)
            gmsh.write(str(path))
        return read_gmsh_file(path)


def _volumes(occ, body, section):
    """Make the volumes, those of a pad from the support up."""
    a, (corners, parts) = body.length, section
    if body.shape == "ring":
        inner = corners[0, 0, 0]
        disc = occ.intersect(
            [(2, occ.addDisk(0, 0, 0, a, a))], [(2, occ.addRectangle(0, 0, 0, a, a))]
        )[0]
        faces = occ.cut(disc, [(2, occ.addDisk(0, 0, 0, inner, inner))])[0]
        way = (0.0, 0.0, 0.6 * a * body.ratios[1])
    else:
        way = (0.0, a * body.ratios[3], 0.0)
        faces = [_quadrilateral(occ, corners[i : i + 2, j : j + 2]) for i, j in np.argwhere(parts)]
    occ.extrude(faces, *way)
    if len(faces) > 1:
        occ.removeAllDuplicates()
    return [tag for _, tag in occ.getEntities(3)]


def _quadrilateral(occ, corners):
    around = corners[[0, 1, 1, 0], [0, 0, 1, 1]]
    points = [occ.addPoint(x, 0.0, z) for x, z in around]
    pairs = zip(points, points[1:] + points[:1], strict=True)
    return 2, occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(p, q) for p, q in pairs])])


def mesh_of(body, comm):
    """Return the mesh of a random body; collective."""
    arrays = comm.bcast(arrays_of(body) if comm.rank == 0 else None)
    own = slice(None) if comm.rank == 0 else slice(0)
    mesh = mesh_from_cells(arrays.cells[own], arrays.points[own], None, comm)
    return TaggedMesh(
        mesh=mesh,
        facet_tags=facet_tags(mesh, arrays.facets, arrays.facet_tags, arrays.facet_names),
        cell_tags=cell_tags(mesh, arrays.cell_tags),
        facet_names=arrays.facet_names,
        cell_names=arrays.cell_names,
    )


class ForceProbe(LawErrorProbe):
    """Measures the error of the force alone, under laws that know neither area nor gap."""

    def _read_on(self, problem, closure, to):
        return np.zeros(3)


def problem_on(body, mesh):
    """Return the contact face of a random body on a mesh, and what makes a problem on a face."""
    names = mesh.facet_names
    fixed = (None, None, 0.0) if body.shape == "ring" else (0.0, 0.0, 0.0)
    held = [Support(tag=names["support"], displacement=fixed)]
    if body.shape == "ring":
        held.append(Support(tag=names["x"], displacement=(0.0, None, None)))
        held.append(Support(tag=names["y"], displacement=(None, 0.0, None)))
    tags = sorted(mesh.cell_names.values())
    materials = dict(zip(tags, body.materials, strict=False))
    whole = materials if len(tags) > 1 else body.materials[0]
    elastic = MeshedBody(mesh, whole, held, order=body.order)
    plane = planar_face(mesh, names["contact"])
    facets = contact_facets(mesh.mesh, mesh.facet_tags.find(names["contact"]), plane.frame)
    face = LoadedFace.of_regions(elastic, (facets,), plane.lengths)
    return face, lambda other: LawContactProblem(other, [body.law], "pointwise")


def stated_and_true(body, comm, *, refinements=2):
    """Return the measured errors of a random body, and the forces on refined meshes.

    Args:
        body: The body.
        comm: MPI communicator.
        refinements: Uniform refinements.

    Returns:
        A record with `dofs` of the meshes, `forces` on them at the same approach [N], `mesh` and
        `quadrature`, the measured errors [N].
    """
    tagged = mesh_of(body, comm)
    face, problem_of = problem_on(body, tagged)
    problem = problem_of(face)
    load = body.pressure * float(face.areas.sum())
    state = problem.solve(Control(force=load, tilt=body.tilt))
    probe = ForceProbe(
        problem=problem,
        face=face,
        state=state,
        problem_with=lambda face, table: problem_of(face),
        table=None,
        samples=(),
        new_laws=(),
        cells=None,
        step=SimpleNamespace(by_force=False),
        comm=comm,
    )
    mesh, quadrature = (float(error[0]) for error in probe.discretisation())
    dofs, forces = [face.body.dofs], [state.force]
    same = Control(approach=state.approach, tilt=body.tilt)
    for _ in range(refinements):
        tagged = refined(tagged)
        finer, problem_of = problem_on(body, tagged)
        forces.append(problem_of(finer).solve(same).force)
        dofs.append(finer.body.dofs)
    return SimpleNamespace(
        dofs=dofs, forces=np.array(forces), mesh=mesh, quadrature=quadrature, load=load
    )


def rough_scene(body, mesh, seed, **keys):
    """Return a scene of a random body with samples of its own under its mean pressure.

    Args:
        body: The body.
        mesh: File of its mesh.
        seed: Seed of the roughness.
        keys: Further keys of the scene.
    """
    rng = np.random.default_rng([47, seed])
    names = [body.materials[0], body.materials[1]]
    modulus = names[-1 if body.shape == "pad" else 0].contact_modulus
    # 2 to 20 % contact area; an rms height of a hundredth of the body's displacement to all of it
    slope = 2.0 * body.pressure / modulus / float(np.exp(rng.uniform(np.log(0.02), np.log(0.2))))
    moved = body.pressure / body.materials[0].young_modulus * body.length
    height = moved * float(np.exp(rng.uniform(np.log(0.01), np.log(1.0))))
    waves = int(rng.integers(4, 8))
    spectrum = {"hurst": float(rng.uniform(0.6, 0.95)), "waves": [2, waves], "seed": seed}
    materials = {"1": names[0], "2": names[1]}
    fixed = ["free", "free", 0.0] if body.shape == "ring" else [0.0, 0.0, 0.0]
    supports = [{"surface": "support", "displacement": fixed}]
    if body.shape == "ring":
        supports.append({"surface": "x", "displacement": [0.0, "free", "free"]})
        supports.append({"surface": "y", "displacement": ["free", 0.0, "free"]})
    section = {"mesh": str(mesh), "contact": "contact", "supports": supports}
    constants = {
        name: {"young_modulus": one.young_modulus, "poisson_ratio": one.poisson_ratio}
        for name, one in materials.items()
    }
    section |= {"materials": constants} if body.shape == "pad" else constants["1"]
    tilt = "free" if body.tilt is None else list(body.tilt)
    # a wave of such a height and slope has about this length
    length = 2.0 * np.pi * height / slope * 3.0
    return Scene.from_dict(
        {
            "surface": {
                "spectrum": {**spectrum, "rms_slope": slope},
                "lengths": [length, length],
            },
            "law": {"kind": "representative"},
            "body": section,
            "load": {"pressure": body.pressure, "steps": 1, "zero": "mean plane", "tilt": tilt},
            "output": {"figures": False, "report": False, "contact": "none"},
            **keys,
        }
    )  # fmt: skip


def contact_scene(body, mesh, seed, **keys):
    """Return a scene that presses a rough rectangle on the contact face of a random body.

    Args:
        body: The body.
        mesh: File of its mesh.
        seed: Seed of the rectangle and of the roughness.
        keys: Further keys of the scene.
    """
    rng = np.random.default_rng([91, seed])
    place, whole = contact_rectangle(body)
    part = 1.0 if rng.random() < 0.4 else float(rng.uniform(0.4, 0.9))  # of the face
    lx, ly = (part * length for length in whole)
    free = rng.uniform(0.0, 1.0, 2) * (rng.random(2) < 0.7)  # else along a side of the face
    place = [at + (1.0 - part) * side * s for at, side, s in zip(place, whole, free, strict=True)]
    waves, slope = int(rng.integers(5, 9)), float(rng.uniform(0.08, 0.2))
    waves = waves if lx > ly else max(3, int(waves * lx / ly))
    sections = rough_scene(body, mesh, seed, accuracy=0.05).written
    material = body.materials[1 if body.shape == "pad" else 0]
    # 2 to 15 % contact area
    pressure = float(rng.uniform(0.01, 0.075)) * material.contact_modulus * slope
    hurst = float(rng.uniform(0.6, 0.95))
    return Scene.from_dict(
        {
            "surface": {
                "spectrum": {"hurst": hurst, "waves": [2, waves], "rms_slope": slope, "seed": seed},
                "lengths": [lx, ly],
                "grid": [max(16, 5 * waves), max(16, round(5 * waves * ly / lx))],
            },
            "body": {
                **sections["body"],
                "place": [float(at) for at in place],
                "element": ("linear", "quadratic")[body.order - 1],
            },
            "coupling": {"kind": "concurrent"},
            "micro": {"finite_slopes": False},
            "load": {"force": pressure * lx * ly, "steps": 1},
            "output": {**sections["output"], "check": "last"},
            **keys,
        }
    )


def contact_rectangle(body):
    """Return the corner and the sides of a rectangle on the contact face of a body [mm].

    The corner counts from that of the face's bounding rectangle.
    """
    a, (r, _, t, depth) = body.length, body.ratios
    if body.shape == "ring":  # a square about the middle of the quarter
        inner = a * (1.0 - 0.6 * r)
        middle, half = 0.5 * (a + inner) / np.sqrt(2.0), 0.3 * (a - inner)
        return 2 * (middle - half,), 2 * (2.0 * half,)
    along = {
        "feet": 0.4 * r * a,
        "foot": a - 0.5 * t * a - 0.5 * r * a,
        "pad": a,
        "wedge": a * (0.5 + r) - 0.3 * t * a,
    }
    return (0.0, 0.0), (along[body.shape], depth * a)
