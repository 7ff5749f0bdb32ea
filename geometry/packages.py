"""Packages that only parts of patchlaw need, and where each of them comes from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from geometry.errors import NotInstalled

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
_NEEDS = {
    package: (what, source)
    for what, packages, source in (_SCENES, _FINITE_ELEMENTS)
    for package in packages.split()
}


@contextmanager
def optional_packages() -> Iterator[None]:
    """Say of a package that turns out to be missing what needs it and where it comes from.

    Raises:
        NotInstalled: When the body imports a package that is not installed and not required.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in _NEEDS:
            raise
        what, source = _NEEDS[error.name]
        raise NotInstalled(
            f"{error.name} is not installed, and {what} need it: {source}"
        ) from error
