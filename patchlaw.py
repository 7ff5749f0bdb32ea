"""Contact of rough surfaces: what most users need, under one name, and the command ``patchlaw``.

The code is in `geometry`, `micro`, `macro` and `multiscale`; a name is imported with its first use.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import TYPE_CHECKING

from support.packages import LazyPackage

# ruff: noqa: F401
if TYPE_CHECKING:  # the names that this module has, see `LazyPackage`
    from geometry import (
        Control,
        Friction,
        InputError,
        NotConverged,
        NotInstalled,
        PatchGrid,
        RigidPlane,
        ShearControl,
        Spectrum,
        Surface,
        read_surface,
        synthesise,
    )
    from macro import ContactProblem, Interface, LawOperator, vector_space
    from micro import HalfSpaceModel
    from multiscale import (
        BodyFields,
        Comparison,
        ContactHistory,
        Difference,
        History,
        LawTable,
        LoadStep,
        Run,
        Scene,
        compare,
        difference,
        export_laws,
        make_setup,
        read_contact,
        read_fields,
        read_history,
        read_laws,
        representative_law,
        run,
        sweep,
    )


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


sys.modules[__name__].__class__ = LazyPackage

if __name__ == "__main__":
    sys.exit(main())
