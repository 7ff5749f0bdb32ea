"""A block of FElupe under a rigid plane through the law of laws.csv; prints its force [N]."""

import sys

import felupe as fem
import numpy as np
from law import law

approach = float(sys.argv[1]) if sys.argv[1:] else 0.008  # of the plane [mm]


class RoughFace:
    """Traction of a law over the closure, the approach of a rigid plane plus u_z."""

    def __init__(self, face):
        self.field, self.results = face, fem.mechanics.Results()
        self.assemble = fem.mechanics.Assemble(vector=self._vector, matrix=self._matrix)

    def _form(self, value, order):
        both = {"u": self.field, "grad_u": [False]} if order == 2 else {}
        of = np.zeros((*(3,) * order, *value.shape))
        of[(2,) * order] = value
        volume = self.field.region.dV
        form = fem.assembly.IntegralForm([of], self.field, volume, grad_v=[False], **both)
        return form.assemble()

    def _vector(self, field=None, **kwargs):
        self.results.force = self._form(law(approach + self.field[0].interpolate()[2])[0], 1)
        return self.results.force

    def _matrix(self, field=None, **kwargs):
        self.results.stiffness = self._form(law(approach + self.field[0].interpolate()[2])[1], 2)
        return self.results.stiffness


mesh = fem.Cube(n=(7, 7, 5))
top, bottom = (np.isclose(mesh.points[:, 2], z) for z in (1.0, 0.0))
field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
region = fem.RegionHexahedronBoundary(mesh, only_surface=True, mask=top)
face = fem.FieldContainer([fem.Field(region, dim=3, values=field[0].values)])
face[0].values = field[0].values  # the same numbers
solid = fem.SolidBody(fem.LinearElastic(E=4000.0, nu=0.3), field)
rough = RoughFace(face)
held = {"bottom": fem.Boundary(field[0], mask=bottom)}
fem.Job([fem.Step([solid, rough], boundaries=held)]).evaluate(verbose=False)
force = float(rough.results.force.toarray().reshape(-1, 3)[:, 2].sum())
print("force", force)
