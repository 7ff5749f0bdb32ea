"""What the scripts of the bodies share: options, names, sizes of edges, the mesh and its file."""

import argparse
from collections.abc import Callable
from pathlib import Path

import gmsh


def in_plane(z: float, reach: float) -> list[int]:
    """Return the surfaces in the plane across z within a distance of the axis."""
    return in_box((-reach, -reach, z), (reach, reach, z))


def in_box(low: tuple[float, float, float], high: tuple[float, float, float]) -> list[int]:
    """Return the surfaces within a box."""
    box = [*(value - 1e-3 for value in low), *(value + 1e-3 for value in high)]
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*box, 2)]


def name(dimension: int, tags: list[int], label: str) -> None:
    """Make a physical group with a name."""
    group = gmsh.model.addPhysicalGroup(dimension, tags)
    gmsh.model.setPhysicalName(dimension, group, label)


def set_size(length: str) -> None:
    """Set the length of edges [mm], an expression in x, y and z; arcs have 24 edges a circle."""
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 24)
    field = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(field, "F", length)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)


def write_body(script: str, says: str, size: float, build: Callable[[float], None]) -> None:
    """Mesh a body and write it, as the options of the command line say.

    Args:
        script: Path of the script; the mesh is written beside it by default.
        says: What the script does.
        size: Length of edges by default [mm].
        build: Makes the geometry, names its parts and sets sizes, for a length of edges [mm].
    """
    parser = argparse.ArgumentParser(description=says.splitlines()[0])
    parser.add_argument("--size", type=float, default=size)
    parser.add_argument("--out", type=Path, default=Path(script).with_suffix(".msh"))
    choice = parser.parse_args()
    gmsh.initialize(["", "-v", "2"], readConfigFiles=False)
    build(choice.size)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(choice.out))
    nodes = len(gmsh.model.mesh.getNodes()[0])
    print(f"{choice.out}: {nodes} nodes, {sum(map(len, gmsh.model.mesh.getElements(3)[1]))} cells")
    gmsh.finalize()
