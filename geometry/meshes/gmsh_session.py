"""Sessions of gmsh that leave signals, and a session of the caller, as they were."""

from __future__ import annotations

import ctypes
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from support.packages import optional_packages

_OPTIONS = {
    "General.AbortOnError": 2,  # errors raise exceptions; 4 would end the process
    "General.Verbosity": 0,
    "General.Terminal": 0,
    "Mesh.Algorithm": 6,
    "Mesh.ElementOrder": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.SubdivisionAlgorithm": 0,
    "Mesh.SaveAll": 0,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
}
"""Options that a caller's own session may have changed; they are restored afterwards."""


@contextmanager
def sigint_untouched() -> Iterator[None]:
    """Import or call gmsh without its replacing the process's handler of SIGINT.

    gmsh does so when a session begins and ends, and release 4.8 already when it is imported. Inside
    this context gmsh has a copy of the module ``signal`` whose function ``signal`` ignores SIGINT.
    Restoring the handler afterwards would leave a moment in which SIGINT ends the process, and
    would fail outside the main thread.
    """

    def ignoring_sigint(number: int, handler: Any) -> Any:
        if number == signal.SIGINT:
            return signal.getsignal(number)
        return signal.signal(number, handler)

    copy: Any = ModuleType("signal")
    vars(copy).update(vars(signal) | {"signal": ignoring_sigint})
    if "gmsh" in sys.modules:
        sys.modules["gmsh"].signal = copy  # type: ignore[attr-defined]
    else:
        sys.modules["signal"] = copy  # for gmsh's own import of it
    try:
        yield
    finally:
        sys.modules["signal"] = signal
        if "gmsh" in sys.modules:
            sys.modules["gmsh"].signal = signal  # type: ignore[attr-defined]


@contextmanager
def gmsh_session(name: str) -> Iterator[Any]:
    """Open a silent session of gmsh with a new current model; restore a caller's afterwards.

    Args:
        name: Name of the new model, which is removed at the end.

    Yields:
        The gmsh module.
    """
    with sigint_untouched(), optional_packages():
        import gmsh  # here, so that everything without a mesh works without gmsh

        owned = not is_initialised(gmsh)
        if owned:
            gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    current = gmsh.model.getCurrent()
    before = {option: gmsh.option.getNumber(option) for option in _OPTIONS}
    try:
        for option, value in _OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add(name)
        yield gmsh
    finally:
        if owned:
            with sigint_untouched():
                gmsh.finalize()
        else:
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            for option, value in before.items():
                gmsh.option.setNumber(option, value)


def is_initialised(gmsh: Any) -> bool:
    """Tell whether gmsh has a session, without a call that may end the process.

    Before its first session gmsh 4.8 answers calls with an error. How it treats errors it then
    reads from uninitialised memory, and where that holds a 4 it ends the process without a message.
    """
    if hasattr(gmsh, "isInitialized"):
        return bool(gmsh.isInitialized())
    if not _has_context(gmsh):
        return False
    try:  # gmsh 4.8 answers 0, or raises, between two sessions
        return bool(gmsh.option.getNumber("Mesh.ElementOrder") >= 1.0)
    except Exception:
        return False


def _has_context(gmsh: Any) -> bool:
    """Tell whether gmsh has had a session, by the singleton of options that a session creates.

    Where the library does not export it, the answer is no, and a caller's session ends with ours.
    No release is known that lacks both this symbol and ``isInitialized``.
    """
    try:
        return ctypes.c_void_p.in_dll(gmsh.lib, "_ZN3CTX9_instanceE").value is not None
    except ValueError:
        return False
