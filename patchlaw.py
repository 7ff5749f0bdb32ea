"""The command ``patchlaw``, from the first moment on: loading the rest takes a while."""

import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130
"""Exit code after SIGINT, as shells have it."""


def main() -> int:
    """Run the command line; see `multiscale.cli.main`.

    SIGINT before and after it ends the process quietly: nothing is open then.

    Returns:
        The exit code.
    """
    former = signal.getsignal(signal.SIGINT)
    if former is not signal.default_int_handler:  # a shell ignores it for what it starts aside
        from multiscale.cli import main as command

        return command()
    signal.signal(signal.SIGINT, _end)
    from multiscale.cli import main as command

    signal.signal(signal.SIGINT, former)
    try:
        return command()
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
