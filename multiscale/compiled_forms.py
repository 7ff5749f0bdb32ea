"""Checks the compiled forms of finite elements, and compiles them ahead of runs.

The checks are of the compiler, of the cache, and of a test solve with a known answer.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiscale.doctor import CheckResult, gathered
from support.collective import on_root
from support.errors import InputError

Array = NDArray[np.float64]

_SMALL_FILES, _SLOW_FILE = 5, 0.02
"""Small files that are made, read and removed, and the mean time of one that deserves a warning
[s]; local disks take less than 1 ms."""
_MOST_ITERATIONS = 60
"""Iterations of the test solve that deserve a warning; multigrid of any kind takes 5 to 30."""
_LARGEST_ERROR = 1e-8
"""Relative error of the force in the test solve; residuals are driven to 1e-9 of the load."""
_SPRING, _APPROACH = 3000.0, 0.002  # of the test solve [MPa/mm, mm]


def compiler_works(comm: Any) -> CheckResult:
    """Compile an empty C program on rank 0, where forms are compiled.

    Args:
        comm: MPI communicator, or None.
    """
    from macro import form_cache as jit

    if comm is not None and comm.rank > 0:
        return CheckResult("ok", "compiles on rank 0")
    path, problem = jit.compiler(), "no C compiler on PATH"
    if path is not None:
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder) / "empty.c"
            source.write_text("#include <math.h>\nint empty(void) { return 0; }\n", "utf-8")
            words = [path, "-c", str(source), "-o", str(source.with_suffix(".o"))]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return CheckResult("ok", path)
        problem = (done.stderr.strip().splitlines() or [f"{path} fails"])[0]
    remedy = "apt-get install gcc libc6-dev; or run patchlaw warm where there is one"
    return CheckResult("warning", problem, remedy)


def cache(comm: Any, folder: Path | None = None) -> CheckResult:
    """Check the cache of compiled forms, as every rank sees it.

    Args:
        comm: MPI communicator, or None.
        folder: Folder of the cache; by default dolfinx's.
    """
    from macro import form_cache as jit
    from macro.compat import form_folder

    folder = folder or form_folder()
    compiled, writable = _compiled(folder), jit.writable(folder)
    slowest = max(gathered(comm, _small_file_seconds(folder) if writable else 0.0))
    fewest = min(gathered(comm, compiled))
    text = f"{folder}, {compiled} compiled"
    if left := jit.stale_locks(folder):
        text = f"{text}; {len(left)} compilation(s) cut short, such as {left[0].name}"
        return CheckResult("fail", text, "clear them with: patchlaw warm")
    if not writable:
        problem = "cannot be written to"
        remedy = "set XDG_CACHE_HOME to a folder that can, unless patchlaw warm filled this one"
    elif fewest < compiled:
        problem = f"another host sees {fewest}"
        remedy = "every host compiles for itself; run patchlaw warm on each, or share the folder"
    elif slowest > _SLOW_FILE:
        problem = f"{1e3 * slowest:.0f} ms for a small file"
        remedy = "copy it to a local disk of each node and set XDG_CACHE_HOME (docs/hpc.md)"
    else:
        return CheckResult("ok", text)
    return CheckResult("warning", f"{text}; {problem}", remedy)


def _compiled(folder: Path) -> int:
    """Count the compiled forms."""
    try:
        return len(list(folder.glob("libffcx_*.c.cached")))
    except PermissionError:  # a folder on the way that this user may not enter
        return 0


def _small_file_seconds(folder: Path) -> float:
    """Return the mean time to make, read and remove a small file [s]."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix="doctor-") as place:
        file, began = Path(place) / "file", time.perf_counter()
        for _ in range(_SMALL_FILES):
            file.write_bytes(b"x" * 512)
            file.read_bytes()
            file.unlink()
        return (time.perf_counter() - began) / _SMALL_FILES


class _Spring:
    """A linear contact law p = k c, for which the answer is known."""

    def pressure(self, closure: Array) -> Array:
        """Return the pressures [MPa]."""
        return _SPRING * closure

    def stiffness(self, closure: Array) -> Array:
        """Return their derivatives [MPa/mm]."""
        return np.full_like(closure, _SPRING)


def known_solve(comm: Any) -> CheckResult:
    """Press a block between rollers and compare the force with the closed form.

    Nothing moves sideways, so that a block of height h shortens by p h / M under a pressure p, with
    the confined modulus M. With a contact law p = k c the approach δ gives p = δ / (1/k + h/M),
    which trilinear elements meet exactly.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    from geometry.meshes.block import BlockShape
    from geometry.patches import PatchGrid
    from geometry.rigid_plane import Control
    from macro import Block, LawContactProblem, LoadedFace, Material, block_mesh

    began = time.perf_counter()
    material = Material(young_modulus=4000.0, poisson_ratio=0.15)
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(10, 10, 8))
    block = Block(block_mesh(shape, comm or MPI.COMM_SELF), material, sides="roller")
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    pressed = LawContactProblem(LoadedFace.of_block(block, patches), [_Spring()] * patches.count)
    state = pressed.solve(Control(approach=_APPROACH))
    seconds = time.perf_counter() - began
    expected = _APPROACH / (1.0 / _SPRING + 1.0 / material.confined_modulus)
    error = abs(state.force / expected - 1.0)
    text = (
        f"{block.dofs} unknowns, {state.linear_iterations} iterations, force off by {error:.0e}, "
        f"{seconds:.1f} s"
    )
    if error > _LARGEST_ERROR:
        return CheckResult("fail", text, "please report this: numbers are wrong")
    if state.linear_iterations > _MOST_ITERATIONS:
        remedy = "the preconditioner is weak here; look at PETSc's options with -- -options_left"
        return CheckResult("warning", text, remedy)
    return CheckResult("ok", text)


def warm(elements: Sequence[str], comm: Any = None) -> tuple[Path, int]:
    """Compile every form that scenes with these elements use.

    Compilations that were cut short more than two minutes ago are cleared first.

    Args:
        elements: Elements of blocks, ``Q1``, ``Q2``, ``P1``, ``P2``; all of them when empty.
        comm: MPI communicator; rank 0 compiles. None for a process on its own.

    Returns:
        The folder of the compiled forms, and how many are in it.

    Raises:
        InputError: When an element is unknown, or forms cannot be compiled or stored.

    Note:
        Collective.
    """
    from geometry.meshes.block import ELEMENTS

    for name in elements:
        if name not in ELEMENTS:
            raise InputError(
                "this element is unknown", key="--element", value=name, allowed=", ".join(ELEMENTS)
            )
    if comm is not None:  # PETSc starts on all ranks together; one rank alone must not
        import macro  # noqa: F401

    def compile_all() -> tuple[Path, int]:
        from macro import form_cache as jit
        from macro.compat import form_folder

        folder = form_folder()
        if jit.writable(folder):
            for source in jit.stale_locks(folder):
                source.unlink(missing_ok=True)
        for element in elements or ELEMENTS:
            _use_all_forms(element)
        return folder, _compiled(folder)

    return on_root(comm, compile_all)


def _use_all_forms(element: str) -> None:
    """Do on a tiny block whatever compiles a form: make its problems and write its fields."""
    from mpi4py import MPI

    from geometry.meshes.block import BlockShape
    from geometry.patches import PatchGrid
    from macro import (
        Block,
        LoadedFace,
        Material,
        UnilateralContactProblem,
        block_mesh,
        write_fields,
    )

    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2), element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    UnilateralContactProblem(block, 0.0)
    rest = block.stiffness.createVecRight()
    block.reaction(rest)
    face = LoadedFace.of_block(block, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))
    with tempfile.TemporaryDirectory() as folder:
        write_fields(Path(folder) / "fields.xdmf", face, [(0, rest.array_r, np.zeros(1))])
