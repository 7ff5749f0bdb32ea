"""Prepares the server that starts processes which draw figures; imported in that server alone.

It lets go of the streams of the process that computes, whose readers would wait for it to end, and
loads matplotlib without the help on its artists.
"""

import os

from patchlaw.support.packages import load_matplotlib_without_help

with open(os.devnull, "r+b") as nowhere:
    for stream in range(3):
        os.dup2(nowhere.fileno(), stream)
load_matplotlib_without_help()
