"""What the program tells of itself: keys of scenes, completion, versions and what fails.

Checks take the MPI communicator, or None, are called on all ranks, and return what is wrong;
nothing where all is well. Forms of finite elements are compiled here ahead of runs, which then need
no compiler.
"""

from __future__ import annotations

import argparse
import difflib
import json
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.multiscale import console
from patchlaw.multiscale.cli.command_line import command_parser
from patchlaw.multiscale.console import say, speaks
from patchlaw.multiscale.machine import cores_statement, detached_processes
from patchlaw.multiscale.scene.schema import Key, scene_keys, scene_schema
from patchlaw.support import InputError, PatchlawError, on_root
from patchlaw.support.packages import load_wheels_mpi, optional_packages

_KEY_OPTIONS = ("--set", "--vary")
"""Options whose values begin with a key of a scene."""
_WITHOUT_SPACE = """
_patchlaw() { _shtab_patchlaw; [[ ${COMPREPLY[0]} == *= ]] && compopt -o nospace 2> /dev/null; }
complete -o bashdefault -F _patchlaw patchlaw
"""
"""What bash needs so that a value can follow a key."""


def print_schema(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Print the JSON Schema of scene files.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if speaks(comm):
        print(json.dumps(scene_schema(), indent=2))


def explain_keys(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Explain the sections of a scene, the keys of one, or one key.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    console.show_pairs(comm, list(_explained(choice.topic)))


def _explained(topic: str | None) -> Iterator[tuple[str, str]]:
    """Yield keys, each with what it means and may be."""
    keys = scene_keys()
    if topic is None:
        yield from ((key.name, key.meaning) for key in keys.values() if "." not in key.name)
        yield "more", "patchlaw help load, patchlaw help load.force"
        return
    named = [key for key in keys.values() if f".{key.name}".endswith(f".{topic}")]
    if not named:
        close = difflib.get_close_matches(topic, keys, n=1)
        hint = f"; did you mean '{close[0]}'?" if close else ""
        sections = ", ".join(key.name for key in keys.values() if key.is_section)
        raise InputError(f"is no key of a scene{hint}", key="KEY", value=topic, allowed=sections)
    for key in named:
        yield key.name, key.meaning if key.is_section else _on_key(key)
        inner = (one for one in keys.values() if one.name.rpartition(".")[0] == key.name)
        yield from ((one.name, one.meaning if one.is_section else _on_key(one)) for one in inner)


def _on_key(key: Key) -> str:
    return f"{key.meaning}\nvalues: {key.values}\ndefault: {key.default}"


def print_completion(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Print a script that a shell evaluates.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if speaks(comm):
        print(completion(choice.shell))


def completion(shell: str) -> str:
    """Return a script that completes the words of ``patchlaw`` in a shell.

    Args:
        shell: ``"bash"`` or ``"zsh"``.
    """
    import shtab  # for this command alone

    parser = command_parser()
    (commands,) = (one for one in parser._actions if isinstance(one, argparse._SubParsersAction))
    for action in (action for one in commands.choices.values() for action in one._actions):
        if action.option_strings and action.option_strings[0] in _KEY_OPTIONS:
            action.complete = dict.fromkeys(("bash", "zsh"), "_patchlaw_keys")
        elif action.type is Path:
            action.complete = shtab.FILE
    keys = " ".join(f"{key.name}=" for key in scene_keys().values() if not key.is_section)
    ways = {"bash": f'compgen -W "{keys}" -- "$1"', "zsh": f"compadd -S '' -- {keys}"}
    preamble = {shell: f"_patchlaw_keys() {{ {way}; }}" for shell, way in ways.items()}
    script = shtab.complete(parser, shell, preamble=preamble)
    return script + _WITHOUT_SPACE * (shell == "bash")


_OLDEST = {
    "numpy": (1, 24), "scipy": (1, 10), "dolfinx": (0, 5), "petsc4py": (3, 18), "mpi4py": (3, 1),
    "h5py": (3, 7), "pydantic": (2, 7), "jinja2": (3, 1), "matplotlib": (3, 6),
}  # fmt: skip
"""The oldest release of every package that patchlaw is tested with."""
_FINITE_ELEMENTS = ("dolfinx", "petsc4py", "mpi4py")
_BODIES = (
    "bodies on meshes, references and isolated laws on tetrahedra, for which dolfinx is not "
    "installed: on Linux by Debian's ./setup.sh, or with Python 3.12 or newer "
    "pip install 'patchlaw[fenicsx]'"
)
_REMEDY = "take Debian 12 or newer and run ./setup.sh, or pip install 'patchlaw[fenicsx]'"


def has_finite_elements() -> bool:
    """Tell whether dolfinx or PETSc is installed, be it that they work or not."""
    for name in _FINITE_ELEMENTS[:2]:
        with suppress(ModuleNotFoundError, ValueError):
            if find_spec(name) is not None:
                return True
    return False


def versions(load: Callable[[str], Any] = import_module) -> tuple[str, str]:
    """Return the packages with their versions, and what of them is missing or too old.

    Args:
        load: Imports a package by its name.
    """
    found, wrong = [f"python {platform.python_version()}"], []
    left_out = () if has_finite_elements() else _FINITE_ELEMENTS
    for name, oldest in _OLDEST.items():
        if name in left_out:
            continue
        try:
            version = str(getattr(load(name), "__version__", "?"))
        except ImportError as error:
            found.append(f"no {name}")
            if name != "matplotlib":  # which draws figures alone
                wrong.append(f"{name}: {error}")
            continue
        found.append(f"{name} {version}")
        numbers = re.match(r"(\d+)\.(\d+)", version)
        if numbers and tuple(map(int, numbers.groups())) < oldest:
            wrong.append(f"{name} {version} is older than {'.'.join(map(str, oldest))}")
    return ", ".join(found), "; ".join([*wrong, _REMEDY]) if wrong else ""


def packages(comm: Any) -> str:
    """Return which packages are missing or too old; name the versions of all.

    Args:
        comm: MPI communicator, or None.
    """
    found, wrong = versions()
    say(comm, found)
    return wrong


def petsc(comm: Any) -> str:
    """Return what PETSc lacks; name its version and packages.

    Args:
        comm: MPI communicator, or None.
    """
    from petsc4py import PETSc

    version = ".".join(map(str, PETSc.Sys.getVersion()))
    have = [name for name in ("mumps", "hypre", "ptscotch") if PETSc.Sys.hasExternalPackage(name)]
    say(comm, f"PETSc {version} with {', '.join(have) or 'no package'}")
    if PETSc.ScalarType(0).dtype.kind == "c":
        return "computes with complex numbers; take a PETSc of real ones (python3-petsc4py-real)"
    return "" if "mumps" in have else "has no MUMPS, which factorises decomposed blocks"


def launcher(comm: Any) -> str:
    """Return whether ranks stand alone; name the MPI of mpi4py, its launcher and the ranks.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    library = MPI.Get_library_version().strip().partition(",")[0].splitlines()[0]
    library = " ".join(library.replace("Version:", "").split())
    own = Path(sys.prefix, "bin", "mpirun")
    command = own if own.exists() else shutil.which("mpirun")
    cores = cores_statement(comm)
    say(comm, f"{library}, {command or 'no mpirun on PATH'}; {cores}")
    if detached := detached_processes():
        return f"one of {detached[1]} processes, each alone; start with the mpirun of {library}"
    return ""


def form_cache(comm: Any) -> str:
    """Return which compilations of forms were cut short.

    Args:
        comm: MPI communicator, or None.
    """
    from patchlaw.macro import disk_caches as jit

    left = jit.stale_locks(jit.form_folder())
    return f"{left[0]} was cut short; clear it with: patchlaw warm" if left else ""


def known_solve(comm: Any) -> str:
    """Return whether a scene with a known answer is off: a level surface on a block on rollers.

    Nothing moves sideways, so that a block of height h and area A takes the force M A δ / h under
    an approach δ, with the confined modulus M; trilinear elements meet it exactly.

    Args:
        comm: MPI communicator, or None.
    """
    from patchlaw.geometry import Material
    from patchlaw.multiscale.runs.scene_run import run
    from patchlaw.multiscale.scene.scene import Scene

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
    # residuals are driven to 1e-9 of the load
    return f"a force is off by {error:.0e}; please report this" if error > 1e-8 else ""


def known_contact(comm: Any) -> str:
    """Return whether the contact of a sphere on cells is off from Hertz' solution.

    Args:
        comm: MPI communicator, or None.
    """
    from patchlaw.geometry import Control, Surface
    from patchlaw.micro import HalfSpaceModel

    radius, approach = 10.0, 1e-3
    x = (np.arange(64) + 0.5) / 64.0 - 0.5
    sphere = Surface(heights=-np.add.outer(x**2, x**2) / (2.0 * radius), lengths=(1.0, 1.0))
    model = HalfSpaceModel(sphere, contact_modulus=1.0, highest=0.0)
    state = model.press(Control(approach=approach, tilt=(0.0, 0.0)))
    hertz = 4.0 / 3.0 * radius**0.5 * approach**1.5
    error = abs(state.force / hertz - 1.0)
    # 13 cells across the contact leave 0.06 over the square of those in its radius: 0.15 %
    return f"a force is off by {error:.0e}; please report this" if error > 3e-3 else ""


CHECKS: dict[str, Callable[[Any], str]] = {
    "packages": packages,
    "PETSc": petsc,
    "MPI": launcher,
    "form cache": form_cache,
    "test solve": known_solve,
}
"""Topics and checks of the doctor, in the order in which they are made."""

_WITHOUT: dict[str, Callable[[Any], str]] = {"packages": packages, "test solve": known_contact}
"""Those without finite elements."""


def examine_machine(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Name versions and what fails, on any rank.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.

    Raises:
        InputError: When a check failed, as a run would end with the same exit code or a worse one.
    """
    load_wheels_mpi()
    failed, whole = [], has_finite_elements()
    for topic, check in (CHECKS if whole else _WITHOUT).items():
        try:
            with optional_packages():
                problem = check(comm)
        except PatchlawError as failure:  # its text holds the remedy
            problem = str(failure)
        except Exception as failure:
            problem = f"{type(failure).__name__}: {failure}; please report this"
        everywhere = [problem] if comm is None else comm.allgather(problem)
        if problem := next(filter(None, everywhere), ""):
            say(comm, f"{topic} fails: {problem}")
            failed.append(topic)
    if failed:
        raise InputError(f"not fit to run: {', '.join(failed)}", key="doctor")
    if not whole:
        say(comm, f"fit to run half-spaces, and blocks without fields of them; not {_BODIES}")


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
        from patchlaw.macro import disk_caches as jit

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

    from patchlaw.geometry import BlockShape, PatchGrid
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
