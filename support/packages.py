"""Packages that only parts of patchlaw need, where each comes from, and which shadow others."""

from __future__ import annotations

import ctypes
import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import chdir, contextmanager, suppress
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import Any

import lazy_loader

from patchlaw.support.errors import NotInstalled

_SCENES = (
    "scenes, figures and files",
    "h5py jinja2 matplotlib pint pydantic pydantic_core rich shtab threadpoolctl",
    "pip install 'patchlaw[scenes]', or with Debian's dolfinx ./setup.sh",
)
_FINITE_ELEMENTS = (
    "bodies of finite elements",
    "basix dolfinx ffcx mpi4py petsc4py ufl",
    "take dolfinx, petsc4py and mpi4py from one source: Debian by ./setup.sh, wheels by "
    "pip install 'patchlaw[fenicsx]' (Python 3.12 or newer), or conda-forge by environment.yml",
)
_VIEWS = (
    "results in three dimensions",
    "pyvista trame_pyvista",
    'pip install ".[view]" in the project\'s folder',
)
_NEEDS = {
    package: (what, source)
    for what, packages, source in (_SCENES, _FINITE_ELEMENTS, _VIEWS)
    for package in packages.split()
}

_PARTS = dict.fromkeys(("basix", "ffcx", "ufl"), "dolfinx") | {"trame_pyvista": "trame-pyvista"}
"""Packages that come with another one, which users know."""

_SHARED = ("numpy", "scipy", "h5py", "mpi4py", "petsc4py")
"""Packages that dolfinx and each other's compiled parts are built against."""
_TOGETHER = ("numpy", "scipy.special", "h5py")


def public_names(package: str, file: str) -> tuple[Any, Any, Any]:
    """Return the lazy ``__getattr__``, ``__dir__`` and ``__all__`` of a package.

    A module is imported with the first use of one of its names, which stand in the package's stub.

    Args:
        package: Its ``__name__``.
        file: Its ``__file__``, beside which the stub lies.
    """
    of_stub, listed, names = lazy_loader.attach_stub(package, file)

    def __getattr__(name: str) -> Any:
        with optional_packages():
            return of_stub(name)

    return __getattr__, listed, names


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
            problem = f"cannot be imported ({' '.join(str(error).split())[:200]})"
        name = _PARTS.get(package, package)
        raise NotInstalled(f"{name} {problem}, and {what} need it: {source}") from error


def wheels_mpi() -> Path | None:
    """Return the MPI library that dolfinx's wheels are linked with; None where it is no wheel."""
    library = Path(sys.prefix, "lib", "libmpi.so.12")
    return library if find_spec("dolfinx_solver") and library.exists() else None


def load_wheels_mpi() -> None:
    """Load the MPI library of dolfinx's wheels, before anything that is linked with it.

    It comes as a wheel of its own, in a folder that mpi4py alone looks into. A library that is
    loaded is found by all others, in whatever order packages are imported, and MPI starts with
    mpi4py as ever.
    """
    if library := wheels_mpi():
        with away():  # UCX reads a file of the working folder
            ctypes.CDLL(str(library))


@contextmanager
def configured_elsewhere() -> Iterator[list[str]]:
    """Let nothing that lies in the working folder configure a library that is loaded meanwhile.

    PETSc (``.petscrc``, ``petscrc``), petsc4py (``petsc.cfg``), dolfinx and FFCx
    (``*_options.json``, in 0.5 ``*_parameters.json``), matplotlib (``matplotlibrc``) and UCX
    (``ucx.conf``) read files there. They are loaded, and forms compiled, while the program's own
    folder is the working folder. PETSc starts without any file of options. For the command line:
    elsewhere these libraries are those of the user's script.

    Yields:
        Further words that PETSc is to start with; it starts when petsc4py is imported.
    """
    finder = _ElsewhereFinder()
    sys.meta_path.insert(0, finder)
    try:
        yield finder.petsc_words
    finally:
        sys.meta_path.remove(finder)


@contextmanager
def away() -> Iterator[None]:
    """Leave the working folder meanwhile, where `configured_elsewhere` asks for it."""
    if not any(isinstance(finder, _ElsewhereFinder) for finder in sys.meta_path):
        yield
        return
    if not hasattr(os, "O_PATH"):  # of Linux alone
        with chdir(sys.prefix):
            yield
        return
    here = os.open(".", os.O_PATH | os.O_DIRECTORY)
    os.chdir(sys.prefix)
    try:
        yield
    finally:
        os.fchdir(here)
        os.close(here)


class _ElsewhereFinder(MetaPathFinder):
    """Finds modules that read files of the working folder when they are loaded."""

    _NAMES = ("matplotlib", "mpi4py.MPI", "petsc4py")

    def __init__(self) -> None:
        self.petsc_words = ["patchlaw", "-skip_petscrc"]

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name in self._NAMES else None
        if spec is not None and spec.loader is not None:
            spec.loader = _ElsewhereLoader(spec.loader, self.petsc_words)
        return spec


class _ElsewhereLoader(Loader):
    def __init__(self, loader: Loader, petsc_words: Sequence[str]) -> None:
        self._loader, self._petsc_words = loader, petsc_words

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        with away():
            return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        module.__loader__ = self._loader
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        with away():
            self._loader.exec_module(module)
            if module.__name__ != "petsc4py":
                return
            compiled = import_module("petsc4py.lib").ImportPETSc()
        # here, as paths among the words start in the working folder
        module.init(self._petsc_words, arch=compiled.__arch__)


def shadows(path: Sequence[str] | None = None) -> dict[str, str]:
    """Return packages that stand before the distribution's, each with a sentence on it.

    Only folders are looked at, which takes microseconds.

    Args:
        path: Folders that Python looks for packages in, in their order; by default `sys.path`.
    """
    sentences = {}
    folders = [folder for folder in (sys.path if path is None else path) if folder]
    for name in _SHARED:
        places = [one for one in folders if os.path.isfile(os.path.join(one, name, "__init__.py"))]
        if len(places) > 1 and os.path.basename(places[-1]) == "dist-packages":
            sentences[name] = (
                f"{name} in {places[0]} shadows the distribution's in {places[-1]}, which dolfinx "
                "and others are built against"
            )
    return sentences


def removal(names: Iterable[str]) -> str:
    """Return the command that removes packages.

    Args:
        names: Their names.
    """
    return f"remove with: {sys.executable} -m pip uninstall {' '.join(names)}"


def conflict() -> str:
    """Return what is wrong with packages that shadow the distribution's; empty where all work.

    Only where something shadows is anything imported.
    """
    if not (shadowing := shadows()):
        return ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions that do not fit
            for name in _TOGETHER:
                import_module(name)
    except Exception as error:  # of any family: ABI, attributes, libraries
        problem = (str(error).splitlines() or ["?"])[0]
        told = "; ".join(shadowing.values())
        return f"{told}; together they fail: {problem}; {removal(shadowing)}"
    return ""


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


def load_matplotlib_without_help() -> None:
    """Load matplotlib without the help on its artists, a third of the time, where it can be loaded.

    For processes in which no user asks for that help.
    """
    with suppress(Exception):  # drawing says why
        vars(import_module("matplotlib.artist"))["kwdoc"] = lambda _: ""


def by_matplotlib(function: str, *arguments: Any) -> Any:
    """Return what a function makes that needs matplotlib, such as a figure.

    Args:
        function: Package, module and name, such as ``"multiscale.results.figures.…"``.
        *arguments: What the function takes.

    Raises:
        NotInstalled: When matplotlib is missing, or cannot be imported.
    """
    module, _, name = function.rpartition(".")
    with optional_packages():
        return getattr(import_module(f"patchlaw.{module}"), name)(*arguments)
