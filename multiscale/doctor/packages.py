"""The doctor's look at packages: their versions, and what PETSc was built with."""

from __future__ import annotations

import importlib
import platform
from typing import Any

from multiscale.doctor.finding import Finding, State

_NEEDED = {
    "numpy": (1, 24),
    "scipy": (1, 10),
    "dolfinx": (0, 5),
    "petsc4py": (3, 18),
    "mpi4py": (3, 1),
    "h5py": (3, 7),
    "gmsh": (4, 8),
    "pydantic": (2, 7),
}
_WISHED = ("matplotlib",)


def versions(comm: Any) -> list[Finding]:
    """Import every package and compare its version with the oldest that patchlaw is tested with.

    Args:
        comm: MPI communicator, or None.
    """
    found: list[str] = [f"python {platform.python_version()}"]
    findings = []
    for name in (*_NEEDED, *_WISHED):
        try:
            version = str(getattr(importlib.import_module(name), "__version__", "?"))
        except ImportError as error:
            state: State = "fail" if name in _NEEDED else "warning"
            findings.append(Finding(name, state, str(error), "run ./setup.sh"))
            continue
        found.append(f"{name} {version}")
        least = _NEEDED.get(name, ())
        if _numbers(version) and _numbers(version) < least:
            wanted = ".".join(map(str, least))
            text = f"{version} is older than {wanted}"
            findings.append(Finding(name, "fail", text, "take Debian 12 or newer and ./setup.sh"))
    return [Finding("packages", "ok", ", ".join(found)), *findings]


def _numbers(version: str) -> tuple[int, ...]:
    """Return major and minor number of a version; empty where they are unknown."""
    parts = version.split(".")[:2]
    return tuple(map(int, parts)) if all(part.isdigit() for part in parts) else ()


def petsc(comm: Any) -> list[Finding]:
    """Look for the solvers and number types that patchlaw needs of PETSc.

    Args:
        comm: MPI communicator, or None.
    """
    from petsc4py import PETSc

    version = ".".join(map(str, PETSc.Sys.getVersion()))
    names = ("mumps", "hypre", "ptscotch")
    have = [name for name in names if PETSc.Sys.hasExternalPackage(name)]
    bits = 8 * PETSc.IntType(0).itemsize
    text = f"{version} with {', '.join(have) or 'no package'}, {bits}-bit indices"
    if PETSc.ScalarType(0).dtype.kind == "c":
        remedy = "take a PETSc of real numbers (Debian: python3-petsc4py-real)"
        return [Finding("PETSc", "fail", f"{version} computes with complex numbers", remedy)]
    if "mumps" not in have:
        remedy = "take a PETSc with MUMPS; decomposed blocks are factorised by it"
        return [Finding("PETSc", "fail", text, remedy)]
    return [Finding("PETSc", "ok", text)]
