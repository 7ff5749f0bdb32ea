"""The command ``patchlaw``, also as ``python -m patchlaw``."""

from __future__ import annotations

import gc
import os
import signal
import sys
from types import FrameType


def main() -> int:
    """Run the command line; see `multiscale.cli.command_line.main`.

    SIGINT before and after the command ends the process quietly: nothing is open then. Where a
    shell ignores SIGINT for what it starts in the background, it stays ignored.

    Python does not search what it imports for objects that only refer to each other: there are
    hundreds of thousands, and they stay.

    Returns:
        The exit code.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    # pydantic would look for plugins through all that is installed, for each section of a scene
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    gc.disable()  # until the command is imported
    try:
        from patchlaw.multiscale.cli.command_line import main as command

        return command()
    finally:
        gc.freeze()  # the process ends: nothing is left to search for
        gc.enable()  # of words that are no command, in a program that called this


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
