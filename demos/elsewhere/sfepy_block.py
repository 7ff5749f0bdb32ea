"""A block of SfePy under a rigid plane through the law of laws.csv; prints its force [N]."""

import sys

import numpy as np
from law import law
from sfepy.base.base import IndexedStruct
from sfepy.discrete import Equation, Equations, FieldVariable, Integral, Material, Problem
from sfepy.discrete.conditions import Conditions, EssentialBC
from sfepy.discrete.fem import FEDomain, Field
from sfepy.mechanics.matcoefs import stiffness_from_youngpoisson
from sfepy.mesh.mesh_generators import gen_block_mesh
from sfepy.solvers.ls import ScipyDirect
from sfepy.solvers.nls import Newton
from sfepy.terms import Term, register_term
from sfepy.terms.terms_surface import ContactPlaneTerm


class RoughPlane(ContactPlaneTerm):
    """Contact with a plane; the force per area at a penetration is that of the law."""

    name = "dw_rough_plane"

    @staticmethod
    def smooth_f(d, k, f0, a, eps, diff):
        return law(d)[1 if diff else 0]


register_term(RoughPlane)
approach = float(sys.argv[1]) if sys.argv[1:] else 0.008  # of the plane [mm]
mesh = gen_block_mesh((1.0, 1.0, 1.0), (7, 7, 5), (0.5, 0.5, 0.5), verbose=False)
domain = FEDomain("block", mesh)
block = domain.create_region("all", "all")
top = domain.create_region("top", "vertices in z > 0.999", "facet")
bottom = domain.create_region("bottom", "vertices in z < 0.001", "facet")
field = Field.from_args("displacement", np.float64, "vector", block, approx_order=1)
u = FieldVariable("u", "unknown", field)
v = FieldVariable("v", "test", field, primary_var_name="u")
solid = Material("solid", D=stiffness_from_youngpoisson(3, 4000.0, 0.3))
corners = np.array([[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 2.0, 0.0], [-1.0, 2.0, 0.0]])
plane = Material(
    "plane",
    f=[1.0, 0.0],
    **{".n": np.array([0.0, 0.0, 1.0]), ".a": np.array([0.0, 0.0, 1.0 - approach]), ".b": corners},
)
integral = Integral("i", order=3)
parts = {"solid": solid, "plane": plane, "v": v, "u": u}
inside = Term.new("dw_lin_elastic(solid.D, v, u)", integral, block, **parts)
rough = "dw_rough_plane(plane.f, plane.n, plane.a, plane.b, v, u)"
contact = Term.new(rough, integral, top, **parts)
problem = Problem("block", equations=Equations([Equation("balance", inside + contact)]))
problem.set_bcs(ebcs=Conditions([EssentialBC("held", bottom, {"u.all": 0.0})]))
problem.set_solver(
    Newton({"i_max": 60, "eps_a": 1e-9}, lin_solver=ScipyDirect({}), status=IndexedStruct())
)
problem.solve(save_results=False)
forces, _ = contact.evaluate(mode="weak", dw_mode="vector")
force = float(forces.reshape(len(forces), 3, -1)[:, 2].sum())
print("force", force)
