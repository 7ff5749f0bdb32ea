# %% [markdown]
# # A rough interface as one term of your own dolfinx problem
#
# What one learns: mesh, material, thermal strain and supports are written in dolfinx as usual; a
# rough face is one more object. Here a brake pad is hot in front and cold at its back, where it
# is also stiffer. Heat bows it towards the disc, and its middle carries more than its edges.
#
#      ─────────────── held, cold, 8 GPa
#     │      pad      │  40 × 20 × 10 mm
#      ╲▁▂▁▃▁▂▁▃▁▂▁▂▁╱  hot, 4 GPa, rough: one law for the whole face
#     ═════════════════ rigid disc, free to tilt, 800 N
#
# Run time: 5 s. `--quick` for a coarser mesh, `--out DIR` for the figure.

# %%
import argparse
from pathlib import Path

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
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/own_problem"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
SIDES, CELLS = (40.0, 20.0, 10.0), [16, 8, 4] if choice.quick else [24, 12, 6]

# %% [markdown]
# The law of the roughness: pressure over closure of a periodic sample, 1 mm wide.

# %%
spectrum = Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=7)
sample = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
law = representative_law([sample], contact_modulus=4167.0, largest_pressure=20.0)

# %% [markdown]
# The pad, as any user of dolfinx writes it.

# %%
pad = mesh.create_box(MPI.COMM_WORLD, [[0.0, 0.0, 0.0], list(SIDES)], CELLS)
V = vector_space(pad, 1)
u, v, x = fem.Function(V), ufl.TestFunction(V), ufl.SpatialCoordinate(pad)
front_heat = fem.Constant(pad, 0.0)  # thermal strain of the hot face
E, nu, heat = 4000.0 * (1.0 + x[2] / SIDES[2]), 0.2, front_heat * (1.0 - x[2] / SIDES[2])
strain = ufl.sym(ufl.grad(u)) - heat * ufl.Identity(3)
stress = E / (1.0 + nu) * (strain + nu / (1.0 - 2.0 * nu) * ufl.tr(strain) * ufl.Identity(3))
back = mesh.locate_entities_boundary(pad, 2, lambda x: np.isclose(x[2], SIDES[2]))
front = mesh.locate_entities_boundary(pad, 2, lambda x: np.isclose(x[2], 0.0))
held = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(V, 2, back), V)

# %% [markdown]
# The interface and the problem.

# %%
rough = Interface(V, None, front, laws=law, indenter=Control(force=800.0, tilt=None))
problem = ContactProblem(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx, u, [held], rough)
found = {}
for name, strained in (("cold", 0.0), ("hot", 2e-3)):
    front_heat.value = strained
    steps = problem.solve()
    found[name] = rough.pressure
    print(
        f"{name:5s} {rough.force:.1f} N on {rough.area:.2f} mm² after {steps} Newton steps, "
        f"pressures up to {max(pad.comm.allgather(rough.pressure.max(initial=0.0))):.2f} MPa"
    )
    balance = problem.reaction()[2] / rough.force

# %%
places = np.vstack(pad.comm.allgather(rough.points))
found = {name: np.concatenate(pad.comm.allgather(part)) for name, part in found.items()}
figure, both = plt.subplots(1, 2, figsize=(8.0, 2.0), dpi=200, layout="constrained")
for axes, (name, part) in zip(both, found.items(), strict=True):  # each on a scale of its own
    drawn = axes.tricontourf(*places.T, part, levels=12, cmap="YlOrRd")
    figure.colorbar(drawn, ax=axes, label="pressure [MPa]", shrink=0.7, format="{x:.2f}")
    title = f"{name}: {part.min():.2f} to {part.max():.2f} MPa"
    axes.set(title=title, aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
middle = np.hypot(places[:, 0] - 20.0, places[:, 1] - 10.0) < 5.0
high = found["hot"][middle].mean() / found["hot"].mean()  # all points have equal shares of the face
if pad.comm.rank == 0:
    about = {"answer": f"carries {high:.1f} times the mean pressure"}
    figure.savefig(choice.out / "own_problem.png", metadata=about)

# %% [markdown]
# The supports carry the force of the laws. The real area hardly depends on how it is distributed.

# %%
assert abs(abs(balance) - 1.0) < 1e-8
assert found["hot"][middle].mean() > 1.1 * found["cold"][middle].mean()
