"""The command line ``patchlaw``."""

from patchlaw.multiscale.cli.command_line import main

__all__ = ["main"]
