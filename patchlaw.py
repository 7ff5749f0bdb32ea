"""Contact of rough surfaces: what most users need, under one name, and the command ``patchlaw``.

The code is in `geometry`, `micro`, `macro` and `multiscale`; a name is imported with its first use.
"""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from types import FrameType
from typing import TYPE_CHECKING, Any

# ruff: noqa: F401
if TYPE_CHECKING:  # what `_HOMES` says, for editors and type checkers
    from geometry import (
        Control,
        InputError,
        NotConverged,
        NotInstalled,
        PatchGrid,
        RigidPlane,
        Spectrum,
        Surface,
        read_surface,
        synthesise,
    )
    from macro import ContactProblem, Interface, LawOperator, vector_space
    from micro import HalfSpaceModel
    from multiscale import (
        Comparison,
        History,
        LawTable,
        LoadStep,
        Run,
        Scene,
        compare,
        export_laws,
        make_setup,
        read_history,
        read_laws,
        representative_law,
        run,
        sweep,
    )

_NAMES = {
    "geometry": "Control InputError NotConverged NotInstalled PatchGrid RigidPlane Spectrum "
    "Surface read_surface synthesise",
    "macro": "ContactProblem Interface LawOperator vector_space",
    "micro": "HalfSpaceModel",
    "multiscale": "Comparison History LawTable LoadStep Run Scene compare export_laws make_setup "
    "read_history read_laws representative_law run sweep",
}
_HOMES = {name: package for package, names in _NAMES.items() for name in names.split()}

__all__ = ["main", *_HOMES]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from support.packages import optional_packages  # loads numpy

        with optional_packages():
            return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'patchlaw' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)


def main() -> int:
    """Run the command line; see `multiscale.cli.command_line.main`.

    SIGINT before and after the command ends the process quietly: nothing is open then. Where a
    shell ignores SIGINT for what it starts in the background, it stays ignored.

    Returns:
        The exit code.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    from multiscale.cli.command_line import main as command

    return command()


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
