# %% [markdown]
# # Squeal: where the modes of a pressed brake pad merge
#
# What one learns: the contact stiffness of three zones moves the natural frequencies of a pad with
# the brake pressure, and friction couples its modes: beyond some coefficient of friction two of
# them merge, and one of the pair grows. Another map of the same roughness merges them elsewhere.
#
#     3 laws of samples ──▶ Interface in a dolfinx problem ──▶ K + contact, M ──▶ natural_modes
#
# Run time: four minutes; works under `mpirun -n N`. `--quick` for few maps and coarse meshes,
# `--out DIR` for the picture.

# %%
import argparse
from pathlib import Path

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.fem.petsc import assemble_matrix
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw import (
    ContactProblem,
    Control,
    Interface,
    PatchGrid,
    Spectrum,
    natural_modes,
    representative_law,
    synthesise,
    vector_space,
)
from patchlaw.multiscale.figures.style import BLUE, FULL_WIDTH, ORANGE, panels, use_style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/squeal"))
choice = parser.parse_args()
COMM, OUT = MPI.COMM_WORLD, choice.out
LENGTHS, DEPTH = (90.0, 45.0), (15.0, 10.0)  # of the face; lining and its back plate below [mm]
LINING, PLATE = (1000.0, 0.25, 2.5e-9), (210e3, 0.3, 7.85e-9)  # E [MPa], ν, density [t/mm³]
CELLS, GRID, MAPS = ((6, 3, 5), 32, 3) if choice.quick else ((12, 6, 5), 64, 10)
PRESSURES = [0.5, 4.0] if choice.quick else [0.25, 0.5, 1.0, 2.0, 4.0]  # [MPa]
AREA, MODES = LENGTHS[0] * LENGTHS[1], 12

# %% [markdown]
# Laws of the lining's roughness, one for each map; a pad has three neighbouring ones in its zones.

# %%
laws = []
for seed in range(MAPS):
    band = Spectrum(hurst=0.8, waves=(2, GRID // 6), rms_height=3e-3, seed=seed)
    sample = synthesise(band, grid=(GRID, GRID), lengths=(1.0, 1.0))
    modulus = LINING[0] / (1.0 - LINING[1] ** 2)
    laws.append(representative_law([sample], modulus, largest_pressure=40.0, tolerance=1e-2))
zones = PatchGrid(grid=(3, 1), lengths=LENGTHS)

# %% [markdown]
# The pad: guided on its back, and along the face at its ends, where friction drives it to one.

# %%
corners = [np.array([0.0, 0.0, -sum(DEPTH)]), np.array([*LENGTHS, 0.0])]
mesh = dmesh.create_box(COMM, corners, list(CELLS), dmesh.CellType.hexahedron)
space = vector_space(mesh, 2)
u, v, w = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
in_lining = ufl.gt(ufl.SpatialCoordinate(mesh)[2], -DEPTH[0])
young, nu, density = (ufl.conditional(in_lining, *pair) for pair in zip(LINING, PLATE, strict=True))
lame, shear = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
dx = ufl.dx(metadata={"quadrature_degree": 4})


def inner(displacement):
    """Return the inner virtual work."""
    strain = ufl.sym(ufl.grad(displacement))
    stress = lame * ufl.tr(strain) * ufl.Identity(3) + 2 * shear * strain
    return ufl.inner(stress, ufl.grad(v)) * dx


def guided(axis, where):
    """Return the condition that a component is held at a place."""
    part = space.sub(axis), space.sub(axis).collapse()[0]
    return fem.dirichletbc(fem.Function(part[1]), fem.locate_dofs_geometrical(part, where), part[0])


back = guided(2, lambda x: np.isclose(x[2], -sum(DEPTH)))
end = guided(0, lambda x: np.isclose(x[0], LENGTHS[0]))
ends = guided(1, lambda x: np.isclose(x[0] % LENGTHS[0], 0.0) & (x[2] < -DEPTH[0] + 1e-6))
bcs = [back, end, ends]
stiffness, mass = (
    assemble_matrix(fem.form(form)) for form in (inner(w), density * ufl.inner(w, v) * dx)
)
stiffness.assemble()
mass.assemble()
top = dmesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], 0.0))


def pressed(first, pressure):
    """Return the face of a pad with three neighbouring laws under a brake pressure."""
    own = [laws[(first + zone) % MAPS] for zone in range(3)]
    force = Control(force=pressure * AREA)
    rough = Interface(space, None, top, laws=own, patches=zones, mode="pointwise", indenter=force)
    ContactProblem(inner(u), u, bcs, rough).solve()
    return rough


def modes(rough, friction):
    """Return the natural modes of the pad while the disc slides below it."""
    whole = stiffness.copy()
    contact = rough.stiffness_matrix(u, sliding=(friction, 0.0))
    whole.axpy(1.0, contact, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    return natural_modes(whole, mass, MODES, bcs=bcs)


def merging(rough):
    """Return the least friction at which a mode grows, and its frequency; none below 2."""
    low, high, found = 0.0, 2.0, modes(rough, 2.0)
    if found.damping.min() > -1.0:
        return np.nan, np.nan
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        tried = modes(rough, middle)
        grows = tried.damping.min() < -1.0
        low, high, found = (low, middle, tried) if grows else (middle, high, found)
    return high, found.frequencies[found.damping.argmin()]


# %% [markdown]
# Frequencies of the pad that sticks nowhere rise with the pressure; friction lets two of them merge.

# %%
curves, merges = [], []
for pressure in PRESSURES:
    rough = pressed(0, pressure)
    curves.append(modes(rough, 0.0).frequencies / 1e3)
    merges.append(merging(rough))
    friction, hertz = merges[-1]
    if COMM.rank == 0:
        first = ", ".join(f"{each:.2f}" for each in curves[-1][:4])
        there = f"{friction:.2f}, {hertz / 1e3:.2f} kHz"
        print(f"{pressure:5.2f} MPa: {first} kHz; modes merge at μ = {there}")
frictions = np.linspace(0.0, 1.2, 4 if choice.quick else 13)
swept = [modes(rough, friction) for friction in frictions]
scatter = [merging(pressed(first, PRESSURES[-1])) for first in range(MAPS)]
least = np.array([friction for friction, _ in scatter])
if COMM.rank == 0:
    print(
        f"at {PRESSURES[-1]} MPa, {MAPS} pads: merge at μ {np.mean(least):.3f} ± {np.std(least):.3f}"
    )

# %%
if COMM.rank == 0:
    use_style()
    OUT.mkdir(parents=True, exist_ok=True)
    figure, (left, middle, right) = panels(1, 3, 2.6, width=FULL_WIDTH)
    left.plot(PRESSURES, np.array(curves)[:, :6], "o-", color=BLUE, markersize=3)
    left.set(xscale="log", xlabel="brake pressure [MPa]", ylabel="frequency [kHz]")
    for friction, found in zip(frictions, swept, strict=True):
        grows = found.damping < -1.0
        for chosen, colour in ((~grows, BLUE), (grows, ORANGE)):
            shown = found.frequencies[chosen][:8] / 1e3
            middle.plot(np.full(len(shown), friction), shown, "o", color=colour, markersize=3)
    middle.set(xlabel="coefficient of friction", ylabel="frequency [kHz]")
    right.plot(PRESSURES, [friction for friction, _ in merges], "o-", color=BLUE)
    right.plot(np.full(MAPS, PRESSURES[-1]), least, "_", color=ORANGE)
    right.set(xscale="log", xlabel="brake pressure [MPa]", ylabel="friction at which modes merge")
    figure.savefig(OUT / "squeal.png", dpi=200)

# %% [markdown]
# Rough contacts stiffen with their pressure, so that the lowest frequency rises with it.

# %%
assert np.all(np.diff([one[0] for one in curves]) > 0.0)
