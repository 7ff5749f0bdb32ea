# %% [markdown]
# # Heat through two bodies and their rough interface, under load
#
# What one learns: the stiffness of a contact law is its conductance (Barber 2003). A force presses
# a pad against a steel plate; where it presses more, more heat passes. Mechanics first, then the
# thermal problem with a conductance per patch that follows from the same law.
#
#      ─────────────── 0 °C, held
#     │   pad, 1.5 W/m/K      │  40 × 20 × 10 mm, rough below
#      ▔▔▔▁▔▁▔▔▁▔▁▔▔▁▔▔▔▔▔▔▔▔▔  h(c) = 2/(1/k₁ + 1/k₂) · (dp/dc)/E*,  per patch
#     │   plate, 50 W/m/K     │  10 mm
#      ─────────────── 100 °C
#
# Run time: 10 s. `--quick` for coarser meshes, `--out DIR` for the figure.

# %%
import argparse
from pathlib import Path

from mpi4py import MPI  # isort: skip  (its library is loaded before dolfinx)
import numpy as np
import ufl
from dolfinx import fem, mesh
from petsc4py import PETSc

import patchlaw as pl
from patchlaw.macro.compat import assemble_matrix, assemble_vector, compile_form, scalar_space
from patchlaw.micro.transport import conductance_per_area, pair_conductivity
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/heat"))
choice = parser.parse_args()
SIDES, CELLS = (40.0, 20.0, 10.0), [16, 8, 4] if choice.quick else [32, 16, 8]
PATCHES, PAD, STEEL, MODULUS = pl.PatchGrid(grid=(8, 4), lengths=SIDES[:2]), 1.5, 50.0, 4167.0

# %% [markdown]
# The law of the roughness, and the pad under a force: bent by a warp of 20 µm at its back.

# %%
spectrum = pl.Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=7)
sample = pl.synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
law = pl.representative_law([sample], contact_modulus=MODULUS, largest_pressure=40.0)
BOX = [[0.0, 0.0, 0.0], list(SIDES)], CELLS
pad = mesh.create_box(MPI.COMM_WORLD, *BOX)
V = pl.vector_space(pad, 1)
u, v = fem.Function(V), ufl.TestFunction(V)
strain = ufl.sym(ufl.grad(u))
stress = 4000.0 / 1.2 * (strain + 0.2 / 0.6 * ufl.tr(strain) * ufl.Identity(3))
back = mesh.locate_entities_boundary(pad, 2, lambda x: np.isclose(x[2], SIDES[2]))
front = mesh.locate_entities_boundary(pad, 2, lambda x: np.isclose(x[2], 0.0))
warp = fem.Function(V)
warp.interpolate(lambda x: np.vstack([0 * x[0], 0 * x[0], 0.02 * (x[0] / SIDES[0] - 0.5) ** 2]))
held = fem.dirichletbc(warp, fem.locate_dofs_topological(V, 2, back))
rough = pl.Interface(
    V, None, front, laws=[law] * PATCHES.count, patches=PATCHES, indenter=pl.Control(force=1.0)
)
problem = pl.ContactProblem(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx, u, [held], rough)


# %%  Mean temperatures of patches by heat into patches of a body whose outer face is held.
def resistances() -> np.ndarray:
    """Return mean temperature of patch i by unit heat into patch j of a body of 1 W/mm/K [K/W]."""
    body = mesh.create_box(MPI.COMM_WORLD, *BOX)
    space, marks = scalar_space(body, 1), fem.Function(scalar_space(body, 0, "DG"))
    T, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    outer = mesh.locate_entities_boundary(body, 2, lambda x: np.isclose(x[2], SIDES[2]))
    outer = fem.locate_dofs_topological(space, 2, outer)
    cold = fem.dirichletbc(PETSc.ScalarType(0.0), outer, space)
    matrix = assemble_matrix(compile_form(ufl.inner(ufl.grad(T), ufl.grad(w)) * ufl.dx), [cold])
    solver = PETSc.KSP().create(body.comm)
    solver.setOperators(matrix)
    solver.setType("cg")
    solver.setTolerances(rtol=1e-12)
    place, loads, found = ufl.SpatialCoordinate(body), [], []
    form = compile_form(marks * ufl.conditional(ufl.lt(place[2], 1e-6), 1.0, 0.0) * w * ufl.ds)
    for patch in range(PATCHES.count):
        marks.interpolate(lambda x, k=patch: 1.0 * (PATCHES.index_of(x[0], x[1]) == k))
        loads.append(assemble_vector(form))
        found.append(loads[-1].duplicate())
        solver.solve(loads[-1], found[-1])
    return np.array([[load.dot(one) for one in found] for load in loads]) / PATCHES.area**2


# %%
R, area, height = resistances() * (1e3 / PAD + 1e3 / STEEL), PATCHES.area, SIDES[2]
solid = height * (1e3 / PAD + 1e3 / STEEL)  # of a column of both bodies, over its area [K mm²/W]
forces = (100.0, 800.0) if choice.quick else (50.0, 100.0, 200.0, 400.0, 800.0, 1600.0)
rows = []
for force in forces:
    rough.indenter = pl.Control(force=force)
    problem.solve()
    k = pair_conductivity([PAD, STEEL])
    h = 1e-6 * conductance_per_area(law.stiffness(rough.patch_closure), MODULUS, k)  # W/mm²/K
    through = 1.0 / np.maximum(h * area, 1e-15)
    heat = np.linalg.solve(R + np.diag(through), np.ones(len(h)))  # W per patch and K
    series = 1.0 / (solid / (area * len(h)) + 1.0 / (h * area).sum())  # isothermal faces
    columns = (1.0 / (solid / area + through)).sum()  # no heat along the faces
    rows.append((force, heat.sum(), series, columns, 1.0 / (h * area).sum()))
    if pad.comm.rank == 0:
        shares = f"interface {rows[-1][-1]:.4f} of {1 / heat.sum():.4f} K/W"
        print(f"{force:6.0f} N: {100 * heat.sum():.3f} W at 100 K, {shares}")

# %%
force, total, series, columns, interface = np.array(rows).T
style.use_style()
figure = style.new_figure(style.FULL_WIDTH, 2.6)
left, right = figure.subplots(1, 2)
lines = (1.0 / total, style.BLUE, "in all"), (interface, style.VERMILLION, "interface")
for values, color, text in lines:
    left.loglog(force, values, "o-", color=color)
    left.text(1.15 * force[1], values[1], text, color=color, va="bottom")
for axis in (left.xaxis, left.yaxis):
    style.logarithmic(axis)
left.set(xlabel="force [N]", ylabel="thermal resistance [K/W]")
style.map_axes(right, SIDES[:2])
shown = right.imshow(1e6 * h.reshape(PATCHES.grid).T, origin="lower", extent=(0, 40, 0, 20))
right.set(title=f"at {forces[-1]:.0f} N")
style.colour_bar(shown, right, "conductance [W/m²/K]")
if pad.comm.rank == 0:
    choice.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(choice.out / "heat.png")

# %% [markdown]
# Uniform heat passes as through resistances in series; any other lies within Maxwell's bounds.

# %%
assert abs(R.sum() / len(R) ** 2 * area * len(R) / solid - 1.0) < 1e-9
assert (columns * (1 - 1e-9) <= total).all() and (total <= series * (1 + 1e-9)).all()
