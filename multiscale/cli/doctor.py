"""Checks whether runs work here: versions, MPI, threads, memory, and a scene with a known answer.

Each check takes the MPI communicator, or None, and is called on all ranks. Forms of finite elements
are compiled here ahead of runs, which then need no compiler.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import threadpoolctl

from patchlaw.multiscale.console import console_of, escape, say, speaks
from patchlaw.multiscale.machine import cluster_nodes, cores_statement, detached_processes
from patchlaw.support.collective import on_root
from patchlaw.support.cores import node_cores
from patchlaw.support.errors import InputError, PatchlawError
from patchlaw.support.packages import load_wheels_mpi, optional_packages, removal, shadows

_OLDEST = {
    "numpy": (1, 24), "scipy": (1, 10), "dolfinx": (0, 5), "petsc4py": (3, 18), "mpi4py": (3, 1),
    "h5py": (3, 7), "pydantic": (2, 7), "jinja2": (3, 1), "matplotlib": (3, 6),
}  # fmt: skip
"""The oldest release of every package that patchlaw is tested with."""


_REMEDY = "take Debian 12 or newer and run ./setup.sh, or pip install 'patchlaw[fenicsx]'"

_COLOUR = {"ok": "green", "warning": "yellow", "fail": "bold red"}


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check.

    Args:
        state: ``"ok"``; ``"warning"``: runs work but slowly, or may fail elsewhere; ``"fail"``:
            runs cannot work.
        text: What was seen, in one line.
        remedy: What to do; empty when all is well.
    """

    state: str
    text: str
    remedy: str = ""


Check = Callable[[Any], CheckResult]


def examine(comm: Any, checks: Mapping[str, Check]) -> Iterator[tuple[str, CheckResult]]:
    """Make checks; one that raises an error has failed.

    Args:
        comm: MPI communicator; None for a process on its own.
        checks: The checks by topic.

    Yields:
        Each topic with the worst result of all ranks, the same on every rank.

    Note:
        Collective.
    """
    load_wheels_mpi()
    for topic, check in checks.items():
        try:
            with optional_packages():
                result = check(comm)
        except PatchlawError as failure:  # its text holds the remedy
            result = CheckResult("fail", str(failure))
        except Exception as failure:
            text = f"{type(failure).__name__}: {failure}"
            result = CheckResult("fail", text, "please report this with the lines above")
        everywhere = [result] if comm is None else comm.allgather(result)
        yield topic, max(everywhere, key=lambda each: ("ok", "warning", "fail").index(each.state))


def packages(comm: Any, load: Callable[[str], Any] = import_module) -> CheckResult:
    """Import every package and compare its version with the oldest that is tested.

    Args:
        comm: MPI communicator, or None.
        load: Imports a package by its name.
    """
    versions, wrong = [f"python {platform.python_version()}"], {}
    for name, oldest in _OLDEST.items():
        try:
            version = str(getattr(load(name), "__version__", "?"))
        except ImportError as error:
            wrong[name] = f"{name}: {error}"
            continue
        versions.append(f"{name} {version}")
        numbers = re.match(r"(\d+)\.(\d+)", version)
        if numbers and tuple(map(int, numbers.groups())) < oldest:
            wrong[name] = f"{name} {version} is older than {'.'.join(map(str, oldest))}"
    if shadowing := shadows():
        text = "; ".join([*shadowing.values(), *wrong.values()])
        return CheckResult("fail" if wrong else "warning", text, removal(shadowing))
    if not wrong:
        return CheckResult("ok", ", ".join(versions))
    state = "warning" if set(wrong) == {"matplotlib"} else "fail"  # it draws figures alone
    return CheckResult(state, "; ".join(wrong.values()), _REMEDY)


def petsc(comm: Any) -> CheckResult:
    """Check the solvers and number types that patchlaw needs of PETSc.

    Args:
        comm: MPI communicator, or None.
    """
    from petsc4py import PETSc

    from patchlaw.macro.linear_solvers.options import has_hypre

    version = ".".join(map(str, PETSc.Sys.getVersion()))
    have = [name for name in ("mumps", "hypre", "ptscotch") if PETSc.Sys.hasExternalPackage(name)]
    bits = 8 * PETSc.IntType(0).itemsize
    coarsened = "by hypre" if has_hypre() else "by PETSc's GAMG, as there is no hypre"
    text, remedy = f"{version} with {', '.join(have) or 'no package'}, {bits}-bit indices", ""
    text = f"{text}; meshes that are no lattice coarsen {coarsened}"
    if PETSc.ScalarType(0).dtype.kind == "c":
        text = f"{version} computes with complex numbers"
        remedy = "take a PETSc of real numbers (Debian: python3-petsc4py-real)"
    elif "mumps" not in have:
        remedy = "take a PETSc with MUMPS; decomposed blocks are factorised by it"
    return CheckResult("fail" if remedy else "ok", text, remedy)


def launcher(comm: Any) -> CheckResult:
    """Name the MPI that mpi4py was built with, and look for a launcher of ranks.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    library = MPI.Get_library_version().strip().partition(",")[0].splitlines()[0]
    library = " ".join(library.replace("Version:", "").split())
    if detached := detached_processes():
        text = f"started as one of {detached[1]} processes, but each stands alone ({library})"
        remedy = f"start with the mpirun of {library}, or srun --mpi=pmix; see docs/hpc.md"
        return CheckResult("fail", text, remedy)
    own = Path(sys.prefix, "bin", "mpirun")
    command = shutil.which("mpirun")
    if own.exists() and (command is None or not own.samefile(command)):
        first = f"{command} comes first on PATH" if command else "it is not on PATH"
        remedy = f"activate the environment, or start ranks with {own}"
        return CheckResult("warning", f"{library} has an mpirun of its own, but {first}", remedy)
    if not command:
        remedy = "for parallel runs: apt-get install mpi-default-bin"
        return CheckResult("warning", f"{library}, no mpirun on PATH", remedy)
    return CheckResult("ok", f"{library}, {command}")


def ranks(comm: Any) -> CheckResult:
    """Count the ranks on every host, and tell the memory for each of them where it is least.

    Args:
        comm: MPI communicator, or None.
    """
    hosts = Counter([platform.node()] if comm is None else comm.allgather(platform.node()))
    places = ", ".join(f"{count} on {host}" for host, count in hosts.items())
    nodes = cluster_nodes(comm)
    each = nodes.memory / max(nodes.ranks)
    remedy = "take fewer ranks per node or a larger node" if each < 1e9 else ""
    text = f"{hosts.total()}: {places}, {each / 1e9:.1f} GB of memory for each"
    return CheckResult("warning" if remedy else "ok", text, remedy)


def threads(comm: Any, libraries: Sequence[dict[str, Any]] | None = None) -> CheckResult:
    """Compare the threads of all ranks on this host with its cores, and name the BLAS.

    Args:
        comm: MPI communicator, or None.
        libraries: What threadpoolctl tells of loaded libraries; by default those of this process.
    """
    import_module("scipy.linalg")  # loads BLAS
    here, text = node_cores(comm), cores_statement(comm)
    if here.threads > len(here.granted):
        problem = f"{here.threads} threads of all ranks on {len(here.granted)} core(s) of a host"
        remedy = "export OMP_NUM_THREADS=1 and start no more ranks than cores"
        return CheckResult("warning", problem, remedy)
    text = f"{text} (OMP_NUM_THREADS {os.environ.get('OMP_NUM_THREADS') or 'not set'})"
    for library in threadpoolctl.threadpool_info() if libraries is None else libraries:
        if library["user_api"] == "blas":
            return CheckResult("ok", f"{text}; {Path(library['filepath']).name}")
    remedy = "apt-get install libopenblas0-pthread (factorisations are 5 to 8 times faster)"
    return CheckResult("warning", f"{text}; the reference BLAS", remedy)


def known_solve(comm: Any) -> CheckResult:
    """Run a scene with a known answer: a level surface on a block between rollers.

    Nothing moves sideways, so that a block of height h and area A takes the force M A δ / h under
    an approach δ, with the confined modulus M; trilinear elements meet it exactly.

    Args:
        comm: MPI communicator, or None.
    """
    from patchlaw.geometry import Material
    from patchlaw.multiscale.scene.scene import Scene
    from patchlaw.multiscale.scene_run import run

    approach, modulus, ratio = 0.002, 4000.0, 0.15
    block = {"height": 1.0, "young_modulus": modulus, "poisson_ratio": ratio, "sides": "roller"}
    scene = {
        "surface": {"heights": np.zeros((8, 8)), "lengths": [1.0, 1.0]},
        "block": block,
        "coupling": {"kind": "reference"},
        "reference": {"meshes": 1},
        "load": {"approach": approach, "steps": 1},
    }
    (step,) = run(Scene.from_dict(scene), comm)
    confined = Material(young_modulus=modulus, poisson_ratio=ratio).confined_modulus
    error = abs(step.force_N / (confined * approach) - 1.0)
    text = f"{step.linear_iterations} iterations, force off by {error:.0e}, {step.wall_s:.1f} s"
    if error > 1e-8:  # residuals are driven to 1e-9 of the load
        return CheckResult("fail", text, "please report this: numbers are wrong")
    return CheckResult("ok", text)


def form_cache(comm: Any, folder: Path | None = None) -> CheckResult:
    """Check the compiler of forms and the cache of compiled ones.

    Args:
        comm: MPI communicator, or None.
        folder: Folder of the cache; by default the user's.
    """
    from patchlaw.macro import form_cache as jit

    folder = folder or jit.form_folder()
    text = f"{folder}, {jit.compiled(folder)} compiled"
    if left := jit.stale_locks(folder):
        text = f"{text}; {len(left)} compilation(s) cut short, such as {left[0].name}"
        return CheckResult("fail", text, "clear them with: patchlaw warm")
    if not jit.writable(folder):
        remedy = "set XDG_CACHE_HOME to a folder that can, unless patchlaw warm filled this one"
        return CheckResult("warning", f"{text}; cannot be written to", remedy)
    if jit.compiler() is None:
        remedy = "apt-get install gcc libc6-dev; or run patchlaw warm where there is one"
        return CheckResult("warning", f"{text}; no C compiler on PATH", remedy)
    return CheckResult("ok", text)


CHECKS: dict[str, Check] = {
    "packages": packages,
    "PETSc": petsc,
    "launcher": launcher,
    "ranks": ranks,
    "threads": threads,
    "form cache": form_cache,
    "test solve": known_solve,
}
"""Topics and checks of the doctor, in the order in which they are made and shown."""


def examine_machine(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Check versions, MPI, threads, memory and compiled forms; solve a problem of known answer.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.

    Raises:
        InputError: When a check failed, as a run would end with the same exit code or a worse one.
    """
    results = {}
    for topic, result in examine(comm, CHECKS):
        results[topic] = result
        if speaks(comm) and not choice.json:
            show(topic, result)
    if speaks(comm) and choice.json:
        listed = [{"topic": topic} | asdict(result) for topic, result in results.items()]
        print(json.dumps(listed, indent=2))
    if failed := [topic for topic, result in results.items() if result.state == "fail"]:
        raise InputError(f"not fit to run: {', '.join(failed)}", key="doctor")


def show(topic: str, result: CheckResult) -> None:
    """Print a line for a result, and its remedy below it.

    Args:
        topic: What was checked.
        result: The result.
    """
    lines, colour = console_of(None), _COLOUR[result.state]
    lines.print(f"[{colour}]{result.state:8}[/][bold]{topic:14}[/]{escape(result.text)}")
    if result.remedy:
        lines.print(f"{'':22}→ {escape(result.remedy)}")


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
    from patchlaw.geometry.meshes.block import ELEMENTS

    if unknown := set(elements) - set(ELEMENTS):
        raise InputError(
            "this element is unknown", key="--element", value=min(unknown),
            allowed=", ".join(ELEMENTS),
        )  # fmt: skip
    if comm is not None:  # PETSc starts on all ranks together; one rank alone must not
        import patchlaw.macro.bodies  # noqa: F401

    def compile_all() -> tuple[Path, int]:
        from patchlaw.macro import form_cache as jit

        folder = jit.form_folder()
        if jit.writable(folder):
            for source in jit.stale_locks(folder):
                source.unlink(missing_ok=True)
        for element in elements or ELEMENTS:
            _use_all_forms(element)
        return folder, jit.compiled(folder)

    return on_root(comm, compile_all)


def _use_all_forms(element: str) -> None:
    """Do on a tiny block whatever compiles a form: make its problems and write its fields."""
    from mpi4py import MPI

    from patchlaw.geometry.meshes.block import BlockShape
    from patchlaw.geometry.patches import PatchGrid
    from patchlaw.macro import (
        Block,
        FieldStep,
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
        at_rest = FieldStep(0, rest.array_r, np.zeros(1))
        write_fields(Path(folder) / "fields.xdmf", face, [at_rest])


def compile_ahead(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Compile all finite element forms now, so that later runs need no compiler.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    folder, count = warm(choice.element, comm)
    say(comm, f"{count} compiled forms in {folder}")
