"""Runs the command line as ``python -m multiscale``."""

import sys

from multiscale.cli.command_line import main

sys.exit(main())
