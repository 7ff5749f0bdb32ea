"""Packages that only parts of patchlaw need, and where each of them comes from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_tb

from support.errors import NotInstalled

_SCENES = (
    "scenes, figures and files",
    "h5py jinja2 matplotlib pint pydantic pydantic_core rich threadpoolctl",
    "pip install 'patchlaw[scenes]', or with Debian's dolfinx ./setup.sh",
)
_FINITE_ELEMENTS = (
    "bodies of finite elements",
    "basix dolfinx ffcx gmsh mpi4py petsc4py ufl",
    "take dolfinx, petsc4py, mpi4py and gmsh from one distribution, Debian by ./setup.sh or as "
    "fenics-dolfinx and python-gmsh from conda-forge; pip has no dolfinx",
)
_LONGEST = 200  # characters of another package's error
_NEEDS = {
    package: (what, source)
    for what, packages, source in (_SCENES, _FINITE_ELEMENTS)
    for package in packages.split()
}


@contextmanager
def optional_packages() -> Iterator[None]:
    """Say of a package that is missing, or fails to load, what needs it and where it comes from.

    Raises:
        NotInstalled: When the body imports a package that is not required, and is not installed or
            raises an error of its own, as for a library that its compiled parts miss.
    """
    try:
        yield
    except Exception as error:
        package = _failed_import(error)
        if package not in _NEEDS:
            raise
        what, source = _NEEDS[package]
        problem = "is not installed"
        if not (isinstance(error, ModuleNotFoundError) and error.name == package):
            problem = f"cannot be imported ({' '.join(str(error).split())[:_LONGEST]})"
        raise NotInstalled(f"{package} {problem}, and {what} need it: {source}") from error


def _failed_import(error: Exception) -> str:
    """Return the package whose import raised an error; nothing where none did."""
    missing = ""
    if isinstance(error, ImportError):
        missing = (error.name or "").partition(".")[0]
    for frame, _ in walk_tb(error.__traceback__):
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if frame.f_code.co_name == "<module>" and package in _NEEDS and missing not in _NEEDS:
            missing = package
    return missing
