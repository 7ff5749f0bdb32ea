"""A block of GetFEM under a rigid plane through the law of laws.csv; prints its force [N]."""

import sys

import getfem
import numpy as np
from law import closure, slopes

approach = float(sys.argv[1]) if sys.argv[1:] else 0.008  # of the plane [mm]
weights = np.diff(slopes, prepend=0.0)  # p = sum of weights times the positive part of c - c_k
c = f"({approach} + u(3))"
p = " + ".join(
    f"{w:.16e}*pos_part({c} - {at:.16e})" for w, at in zip(weights, closure[:-1], strict=True)
)
x, z = np.linspace(0.0, 1.0, 7), np.linspace(0.0, 1.0, 5)
mesh = getfem.Mesh("cartesian", x, x, z)
mesh.set_region(1, mesh.outer_faces_with_direction([0, 0, 1.0], 0.1))
mesh.set_region(2, mesh.outer_faces_with_direction([0, 0, -1.0], 0.1))
space = getfem.MeshFem(mesh, 3)
space.set_fem(getfem.Fem("FEM_QK(3,1)"))
points = getfem.MeshIm(mesh, getfem.Integ("IM_GAUSS_PARALLELEPIPED(3,4)"))
young, poisson = 4000.0, 0.3
model = getfem.Model("real")
model.add_fem_variable("u", space)
model.add_initialized_data("lame", young * poisson / ((1 + poisson) * (1 - 2 * poisson)))
model.add_initialized_data("shear", young / (2 * (1 + poisson)))
model.add_isotropic_linearized_elasticity_brick(points, "u", "lame", "shear")
model.add_Dirichlet_condition_with_simplification("u", 2)
model.add_nonlinear_term(points, f"({p})*Test_u(3)", 1)
model.solve("max_res", 1e-9, "max_iter", 60)
force = getfem.asm_generic(points, 0, p, 1, model)
print("force", force)
