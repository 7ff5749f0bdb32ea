"""Errors that a user can meet, each with the exit code of the command line."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import Enum
from typing import Any, Self

_LONGEST = 200  # characters of a value in a message


class _Value(Enum):
    """Marks an error without a value; members of an enum stay identical when they are pickled."""

    NONE = "none"


class PatchlawError(Exception):
    """Base of every error that patchlaw raises on purpose."""

    exit_code = 1


class InputError(PatchlawError, ValueError):
    """Something the user gave is wrong; nothing has been computed or written.

    The text reads ``file: key = value: problem (allowed: …)``, with the parts that are known.

    Args:
        problem: What is wrong, in one sentence without a full stop.
        value: The offending value; left out of the text when not given.
        allowed: What would be accepted.
        key: Dotted key of the scene file, such as ``block.young_modulus``.
        file: The file that the value came from.
    """

    exit_code = 2

    def __init__(
        self,
        problem: str,
        *,
        value: Any = _Value.NONE,
        allowed: str | None = None,
        key: str | None = None,
        file: str | None = None,
    ) -> None:
        self.problem, self.value, self.allowed = problem, value, allowed
        self.key, self.file = key, file
        super().__init__(problem)

    def located(self, *, key: str | None = None, file: str | None = None) -> InputError:
        """Return the same error with key and file filled in where they are still unknown."""
        return type(self)(
            self.problem,
            value=self.value,
            allowed=self.allowed,
            key=self.key or key,
            file=self.file or file,
        )

    def of_content(self, file: str) -> InputError:
        """Return the same error about what a file holds, its value last, as it is that of no key.

        Args:
            file: The file.
        """
        if self.value is _Value.NONE or self.key:
            return self.located(file=file)
        problem = f"{self.problem}: {shortened(self.value)}"
        return type(self)(problem, allowed=self.allowed, file=self.file or file)

    def __str__(self) -> str:
        shown = None if self.value is _Value.NONE else shortened(self.value)
        key = self.key and (self.key if len(self.key) <= _LONGEST else f"{self.key[:_LONGEST]}…")
        subject = " = ".join(part for part in (key, shown) if part)
        text = ": ".join(part for part in (self.file, subject, self.problem) if part)
        return f"{text} (allowed: {self.allowed})" if self.allowed else text


@contextmanager
def located(
    file: str | None = None, key: str | None = None, *, unreadable: str = ""
) -> Iterator[None]:
    """Give errors of the input that occur meanwhile a file and a key, where they have none.

    Args:
        file: The file.
        key: The key.
        unreadable: What to say of errors of all other families, which libraries that read files
            raise; these stay what they are when it is not given.
    """
    try:
        yield
    except InputError as error:
        raise error.located(key=key, file=file) from None
    except Exception as error:
        if not unreadable:
            raise
        raise InputError(f"{unreadable}: {error}", key=key, file=file) from None


class NotInstalled(PatchlawError, ImportError):
    """A package is missing that only a part of patchlaw needs; see `support.packages`."""

    exit_code = 2


class NotConverged(PatchlawError, RuntimeError):
    """An iteration ended without a solution; accepted load steps before it remain.

    Args:
        what: Which iteration, and at which load.
        reason: The name of the reason.
        iterations: Iterations spent.
        remedy: What to change, with the scene key where there is one.

    Attributes:
        history: The load steps before it, where a whole run was asked for.
    """

    exit_code = 3
    history: Any = None

    def __init__(self, what: str, *, reason: str, iterations: int, remedy: str) -> None:
        self.what, self.reason, self.iterations, self.remedy = what, reason, iterations, remedy
        super().__init__(
            f"{what} did not converge: {reason} after {iterations} iterations; {remedy}"
        )

    def advised(self, more: str) -> Self:
        """Return the same error with more advice behind its remedy."""
        return self._again(self.what, self.reason, self.iterations, f"{self.remedy}; {more}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Let the error travel between ranks as what it is."""
        return self._again, (self.what, self.reason, self.iterations, self.remedy)

    @classmethod
    def _again(cls, what: str, reason: str, iterations: int, remedy: str) -> Self:
        return cls(what, reason=reason, iterations=iterations, remedy=remedy)


class NotBalanced(NotConverged):
    """Supports do not bear what contact exerts on a body, so that results are wrong.

    Smaller load steps do not help.
    """


class NotWritten(PatchlawError, RuntimeError):
    """A file cannot be written: no space left, a folder gone; no half of it stands anywhere.

    What a run had accepted before is in its last checkpoint.
    """

    exit_code = 5


class OutOfMemory(PatchlawError, RuntimeError):
    """The system gave no more memory; what a run had accepted before is in its last checkpoint."""

    exit_code = 5


def did_you_mean(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> str:
    """Return the end of a sentence that offers the nearest known word; empty when none is near.

    Args:
        word: What was written; case does not count.
        known: What could have been meant, the likelier first; of dotted names the last part counts.
        cutoff: Likeness from which words are near, 1 when they differ by case alone.
    """
    words = {one.rpartition(".")[2].casefold(): one for one in reversed(list(known))}
    near = difflib.get_close_matches(word.casefold(), words, n=1, cutoff=cutoff)
    return f"; did you mean '{words[near[0]]}'?" if near else ""


def shortened(value: Any) -> str:
    """Return what stands for a value in a message: a line, however long the value is.

    Args:
        value: The value.
    """
    short = reprlib.Repr()
    short.maxlist = short.maxtuple = short.maxdict = 20
    # to be cut at their end, not in the middle
    short.maxstring = short.maxother = short.maxlong = 10 * _LONGEST
    try:
        text = short.repr(value)
    except ValueError:  # of thousands of digits
        return f"<{type(value).__name__}>"
    text = re.sub(r"\s*\n\s*", " ", text)  # numpy breaks lines of arrays
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
