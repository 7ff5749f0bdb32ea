"""Standard streams that may be full, closed or unable to show a letter."""

from __future__ import annotations

import codecs
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

_PLAIN = str.maketrans(
    {
        **dict.fromkeys("µμ", "u"),
        **{"×": "x", "·": "*", "−": "-", "–": "-", "→": "->", "…": "...", "±": "+-"},
        **{"≤": "<=", "≥": ">=", "²": "^2", "³": "^3", "½": "1/2", "¼": "1/4", "é": "e"},
        **{"α": "alpha", "δ": "delta", "κ": "kappa", "λ": "lambda", "ν": "nu", "σ": "sigma"},
    }
)
_HANDLER = "patchlaw"


class SturdyStream:
    """A text stream that takes what is written to it even when it has nowhere to go.

    Args:
        stream: The stream; None for one that was closed before this process began.

    Attributes:
        failure: What the system said when it took no more; None while all is well.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.failure: OSError | None = None
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=_HANDLER)

    def write(self, text: str) -> int:
        """Write a text, or drop it when something failed before."""
        self._attempt(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Write what is buffered, likewise."""
        if self._stream is not None:
            self._attempt(self._stream.flush)

    def isatty(self) -> bool:
        """Tell whether a person reads along."""
        return self._stream is not None and self._stream.isatty()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _attempt(self, write: Any) -> None:
        if self.failure is not None:
            return
        if self._stream is None or self._stream.closed:
            self.failure = OSError("it is closed")
            return
        try:
            write()
        except OSError as error:
            self.failure = error
            with suppress(OSError, ValueError):  # what its buffer holds goes nowhere at the end
                number = self._stream.fileno()
                with open(os.devnull, "wb") as nowhere:
                    os.dup2(nowhere.fileno(), number)


@contextmanager
def sturdy_streams() -> Iterator[tuple[SturdyStream, SturdyStream]]:
    """Let nothing that is printed end what this process computes.

    Letters that a stream cannot encode are spelt with those it can. File descriptors that are
    closed are opened on nothing: else the next file would get the number of a standard stream.

    Yields:
        Output and error stream, which tell afterwards whether all was written.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
    codecs.register_error(_HANDLER, _spelt)
    former = sys.stdout, sys.stderr
    output, errors = SturdyStream(sys.stdout), SturdyStream(sys.stderr)
    sys.stdout, sys.stderr = output, errors
    try:
        yield output, errors
    finally:
        for stream in (output, errors):
            stream.flush()
        sys.stdout, sys.stderr = former


def _spelt(error: UnicodeError) -> tuple[str | bytes, int]:
    """Spell what a stream cannot encode, as an error handler of `codecs`."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end].translate(_PLAIN)
    return text.encode("ascii", "backslashreplace").decode("ascii"), error.end
