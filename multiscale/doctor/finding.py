"""What one check of the doctor found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

State = Literal["ok", "warning", "fail"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check found.

    Args:
        topic: What was looked at.
        state: ``"ok"``; ``"warning"``: runs work but slowly, or may fail elsewhere; ``"fail"``:
            runs cannot work.
        text: What was found, in one line.
        remedy: What to do; empty when all is well.
    """

    topic: str
    state: State
    text: str
    remedy: str = ""
