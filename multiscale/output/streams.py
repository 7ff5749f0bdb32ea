"""Standard streams that may be full or closed, or may lack a character."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


class SturdyStream:
    """A text stream to which writing never fails: after the first error it drops the text.

    Args:
        stream: The stream; None for one that was closed before this process began.

    Attributes:
        failure: The first error; None while all text was written.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.failure: OSError | None = None
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")

    def write(self, text: str) -> int:
        """Write a text, or drop it after an error."""
        self._attempt(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Write the buffered text, or drop it after an error."""
        if self._stream is not None:
            self._attempt(self._stream.flush)

    def isatty(self) -> bool:
        """Tell whether the stream is a terminal."""
        return self._stream is not None and self._stream.isatty()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _attempt(self, write: Any) -> None:
        if self.failure is not None:
            return
        try:
            if self._stream is None or self._stream.closed:
                raise OSError("it is closed")
            write()
        except OSError as error:
            self.failure = error
            # Python flushes the buffer at exit. That must not fail again, so it goes nowhere.
            with suppress(OSError, ValueError, AttributeError):
                number = self._stream.fileno()
                with open(os.devnull, "wb") as nowhere:
                    os.dup2(nowhere.fileno(), number)


@contextmanager
def sturdy_streams() -> Iterator[tuple[SturdyStream, SturdyStream]]:
    """Replace the standard streams, so that an error of printing does not end a computation.

    Characters that a stream cannot encode are escaped. Closed file descriptors are opened on the
    null device: otherwise the next file would get the number of a standard stream.

    Yields:
        Output and error stream; their `failure` shows afterwards whether all text was written.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # It gets the lowest free number, which is this one.
    former = sys.stdout, sys.stderr
    output, errors = SturdyStream(sys.stdout), SturdyStream(sys.stderr)
    sys.stdout, sys.stderr = output, errors
    try:
        yield output, errors
    finally:
        for stream in (output, errors):
            stream.flush()
        sys.stdout, sys.stderr = former
