#!/usr/bin/env bash
# gmsh: volumes and lengths of a ball of second order, by getElementQualities(…, "volume") and the plugin MeshVolume.
#
# Guess: the integral of an element's Jacobian, curved as it is.
# Seen: tetrahedra and lines are measured between their corners, 0.965 of the ball's true volume and the same as at first order, where their
# Jacobians integrate to 0.9998. Triangles, prisms and hexahedra are measured as they are curved. No warning.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2
python - <<'END'
import gmsh
import numpy as np


def measured(dimension, kind):
    """Return what gmsh says that elements measure, by two ways, what their Jacobians integrate to, and what the shape does."""
    gmsh.clear()
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    if kind == "ball":
        gmsh.model.occ.addSphere(0, 0, 0, 1)
    else:
        disk = gmsh.model.occ.addDisk(0, 0, 0, 1, 1)
        gmsh.model.occ.extrude([(2, disk)], 0, 0, 1, [2], recombine=True)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.RecombineAll", kind == "hexahedra")
    gmsh.model.mesh.generate(3)
    (of_kind,), (elements,), _ = gmsh.model.mesh.getElements(dimension)
    quality = gmsh.model.mesh.getElementQualities(elements, "volume").sum()
    gmsh.plugin.setNumber("MeshVolume", "Dimension", dimension)
    gmsh.plugin.run("MeshVolume")
    (view,) = gmsh.view.getTags()
    plugin = gmsh.view.getListData(view)[2][0][3]
    gmsh.view.remove(view)
    points, weights = gmsh.model.mesh.getIntegrationPoints(of_kind, "Gauss8")
    jacobians = gmsh.model.mesh.getJacobians(of_kind, points)[1].reshape(-1, len(weights))
    exact = sum(gmsh.model.occ.getMass(*one) for one in gmsh.model.getEntities(dimension) if gmsh.model.occ.getMass(*one) > 1e-9)
    return np.array([quality, plugin, np.sum(jacobians @ weights), exact])


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
for dimension, kind, seen in ((3, "ball", 0.9650), (1, "ball", 0.9959), (2, "ball", 0.9999), (3, "prisms", 1.0000), (3, "hexahedra", 1.0000)):
    found = measured(dimension, kind)
    quality, plugin, integral = found[:3] / found[3]
    print(f"{kind}, dimension {dimension}: quality {quality:.4f}, plugin {plugin:.4f}, Jacobians {integral:.4f} of {found[3]:.5f}")
    np.testing.assert_allclose([quality, plugin], seen, atol=2e-4)
    np.testing.assert_allclose(integral, 1.0, atol=2e-4)
gmsh.finalize()
END
