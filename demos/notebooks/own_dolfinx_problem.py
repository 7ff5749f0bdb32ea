# %% [markdown]
# # My own dolfinx problem with a rough face
#
# A pad is pressed on a flat disc with 800 N. Mesh, material and supports are those of a problem in
# dolfinx; its rough face is one more term, a contact law that a sample of the roughness has given.
# What one learns: heat bows the pad, and its middle carries more than the mean pressure.

# %%
# %matplotlib inline
from mpi4py import MPI  # isort: skip  (its library is loaded before dolfinx)
import matplotlib.pyplot as plt
import numpy as np
import ufl
from dolfinx import fem, mesh

from patchlaw import (
    ContactProblem,
    Control,
    Interface,
    Spectrum,
    representative_law,
    synthesise,
    vector_space,
)  # fmt: skip

spectrum = Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=7)
sample = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
sample

# %% [markdown]
# The law of the sample: pressure against closure, up to 20 MPa.

# %%
law = representative_law([sample], contact_modulus=4167.0, largest_pressure=20.0)
law

# %% [markdown]
# The pad in dolfinx. Its lining is stiffer and colder at the back: $\boldsymbol\sigma = \mathbb{C}
# : (\boldsymbol\varepsilon - \alpha\theta\,\mathbf{1})$.

# %%
pad = mesh.create_box(MPI.COMM_WORLD, [[0, 0, 0], [40, 20, 10]], [20, 10, 5])
V = vector_space(pad, 1)
v, x = ufl.TestFunction(V), ufl.SpatialCoordinate(pad)


def face(z):
    """Return the facets of the pad at a height."""
    return mesh.locate_entities_boundary(pad, 2, lambda x: np.isclose(x[2], z))


back = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(V, 2, face(10.0)), V)


def pressed(expansion):
    """Press the pad, whose face has expanded, and return its interface."""
    u = fem.Function(V)
    E, nu = 4000.0 * (1 + x[2] / 10), 0.2
    strain = ufl.sym(ufl.grad(u)) - expansion * (1 - x[2] / 10) * ufl.Identity(3)
    stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * ufl.tr(strain) * ufl.Identity(3))
    rough = Interface(V, None, face(0.0), laws=law, indenter=Control(force=800.0, tilt=None))
    form = ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx
    ContactProblem(form, u, [back], rough).solve()
    return rough


cold, hot = pressed(0.0), pressed(5e-4)
for name, rough in (("cold", cold), ("hot", hot)):
    approach = 1e3 * rough.plane.approach
    print(f"{name}: {rough.force:.1f} N on {rough.area:.2f} mm², plane at {approach:.3f} µm")

# %% [markdown]
# The pressure along the middle of the face. A process sees its own points.

# %%
figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
for name, rough in (("cold", cold), ("hot", hot)):
    points = np.asarray(rough.points)
    near = np.abs(points[:, 1] - 10.0) < 1.0
    order = np.argsort(points[near, 0])
    axes.plot(points[near, 0][order], rough.pressure[near][order], ".", label=name)
axes.set(xlabel="x [mm]", ylabel="pressure [MPa]")
axes.legend()
plt.show()

# %%
assert abs(hot.force - 800.0) < 1e-3 and abs(cold.force - 800.0) < 1e-3
assert f"{hot.area:.2f}" == "5.57" and f"{1e3 * hot.plane.approach:.3f}" == "1.673"
