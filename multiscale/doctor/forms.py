"""The doctor's look at the form compiler and its cache, and a solve with a known answer."""

from __future__ import annotations

import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiscale.doctor.finding import Finding

Array = NDArray[np.float64]

_SLOW = 0.02  # seconds to make, read and remove a small file: local disks take far below 1 ms
_MODULUS, _RATIO, _SPRING, _APPROACH = 4000.0, 0.15, 3000.0, 0.002
_MOST_ITERATIONS = 60  # multigrid of any kind takes 5 to 30


def compiler_works(comm: Any) -> list[Finding]:
    """Compile an empty C program on rank 0, where forms are compiled.

    Args:
        comm: MPI communicator, or None.
    """
    from macro import form_cache as jit

    if comm is not None and comm.rank > 0:
        return []
    path = jit.compiler()
    remedy = "apt-get install gcc libc6-dev; or run patchlaw warm where there is one"
    if path is None:
        return [Finding("form compiler", "warning", "no C compiler on PATH", remedy)]
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "empty.c"
        source.write_text("#include <math.h>\nint empty(void) { return 0; }\n", encoding="utf-8")
        words = [path, "-c", str(source), "-o", str(source.with_suffix(".o"))]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        text = (done.stderr.strip().splitlines() or [f"{path} fails"])[0]
        return [Finding("form compiler", "warning", text, remedy)]
    return [Finding("form compiler", "ok", path)]


def cache(comm: Any) -> list[Finding]:
    """Look at the cache of compiled forms, as every rank sees it.

    Args:
        comm: MPI communicator, or None.
    """
    from macro import form_cache as jit
    from macro.compat import form_cache

    folder = form_cache()
    finished = _compiled(folder)
    writable = jit.writable(folder)
    slowest = max(_gathered(comm, _small_file_s(folder) if writable else 0.0))
    fewest = min(_gathered(comm, finished))
    text = f"{folder}, {finished} compiled"
    if left := jit.stale_locks(folder):
        text = f"{text}; {len(left)} compilation(s) cut short, such as {left[0].name}"
        return [Finding("form cache", "fail", text, "clear them with: patchlaw warm")]
    if not writable:
        remedy = "set XDG_CACHE_HOME to a folder that can, unless patchlaw warm filled this one"
        return [Finding("form cache", "warning", f"{text}; cannot be written to", remedy)]
    if fewest < finished:
        text = f"{text}; another host sees {fewest}"
        remedy = "every host compiles for itself; run patchlaw warm on each, or share the folder"
        return [Finding("form cache", "warning", text, remedy)]
    if slowest > _SLOW:
        text = f"{text}; {1e3 * slowest:.0f} ms for a small file"
        remedy = "copy it to a local disk of each node and set XDG_CACHE_HOME (demos/hpc/README.md)"
        return [Finding("form cache", "warning", text, remedy)]
    return [Finding("form cache", "ok", text)]


def _compiled(folder: Path) -> int:
    try:
        return len(list(folder.glob("libffcx_*.c.cached")))
    except PermissionError:  # a folder on the way that this user may not enter
        return 0


def _small_file_s(folder: Path) -> float:
    """Return the median time to make, read and remove a small file [s]."""
    folder.mkdir(parents=True, exist_ok=True)
    times = []
    with tempfile.TemporaryDirectory(dir=folder, prefix="doctor-") as place:
        for number in range(5):
            began = time.perf_counter()
            file = Path(place) / str(number)
            file.write_bytes(b"x" * 512)
            file.read_bytes()
            file.unlink()
            times.append(time.perf_counter() - began)
    return float(np.median(times))


class _Spring:
    """A linear contact law p = k c, for which the answer is known."""

    def pressure(self, closure: Array) -> Array:
        """Return the pressures [MPa]."""
        return _SPRING * closure

    def stiffness(self, closure: Array) -> Array:
        """Return their derivatives [MPa/mm]."""
        return np.full_like(closure, _SPRING)


def known_solve(comm: Any) -> list[Finding]:
    """Press a block between rollers and compare the force with the closed form.

    Nothing moves sideways, so that a layer of height h yields by p h / M, with the confined
    modulus M: p = δ / (1/k + h/M), exactly what trilinear elements give.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    from geometry.meshes.block import BlockShape
    from geometry.patches import PatchGrid
    from geometry.rigid_plane import Control
    from macro import Block, Interface, LawContactProblem, Material, block_mesh

    began = time.perf_counter()
    material = Material(young_modulus=_MODULUS, poisson_ratio=_RATIO)
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(10, 10, 8))
    block = Block(block_mesh(shape, comm or MPI.COMM_SELF), material, sides="roller")
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    pressed = LawContactProblem(block, Interface(block, patches), [_Spring()] * patches.count)
    state = pressed.solve(Control(approach=_APPROACH))
    seconds = time.perf_counter() - began
    expected = _APPROACH / (1.0 / _SPRING + 1.0 / material.confined_modulus)
    error = abs(state.force / expected - 1.0)
    text = (
        f"{block.dofs} unknowns, {state.linear_iterations} iterations, force off by {error:.0e}, "
        f"{seconds:.1f} s"
    )
    if error > 1e-8:  # residuals are driven to 1e-9 of the load
        return [Finding("test solve", "fail", text, "please report this: numbers are wrong")]
    if state.linear_iterations > _MOST_ITERATIONS:
        remedy = "the preconditioner is weak here; look at PETSc's options with -- -options_left"
        return [Finding("test solve", "warning", text, remedy)]
    return [Finding("test solve", "ok", text)]


def _gathered(comm: Any, value: Any) -> list[Any]:
    return [value] if comm is None else comm.allgather(value)
