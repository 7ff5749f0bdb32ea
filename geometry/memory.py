"""The memory of this machine that one process may take."""

from __future__ import annotations

import math
import os
import resource

PROGRAM = 1.0e9
"""Address space of the program with all its libraries; 0.88 GB were measured on two cores [B]."""


def address_space() -> float:
    """Return the address space that this process may fill with data [B].

    That is its limit (``ulimit -v``), less what the program takes itself; infinite without one.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else limit - PROGRAM


def process_memory() -> float:
    """Return the memory that this process may fill with data: the machine's, or less [B]."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return min(float(physical), address_space())
