"""Draws what results hold, in one style; matplotlib is loaded when something is drawn."""

from importlib import import_module
from typing import Any

from patchlaw.support.packages import optional_packages


def by_matplotlib(function: str, *arguments: Any) -> Any:
    """Return what a function makes that needs matplotlib, such as a figure.

    Args:
        function: Module and name of the function, within `multiscale`.
        *arguments: What the function takes.

    Raises:
        NotInstalled: When matplotlib is missing, or cannot be imported.
    """
    module, _, name = function.rpartition(".")
    with optional_packages():
        return getattr(import_module(f"patchlaw.multiscale.{module}"), name)(*arguments)
