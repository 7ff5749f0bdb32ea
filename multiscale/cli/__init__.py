"""The command line ``patchlaw``."""

from multiscale.cli.command_line import main

__all__ = ["main"]
