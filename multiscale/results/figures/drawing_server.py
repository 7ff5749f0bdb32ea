"""Prepares the server that starts processes which draw figures; imported in that server alone.

It lets go of the streams of the process that computes, whose readers would wait for it to end, and
loads matplotlib without the help on its artists, which takes a third of the time to load. Where
matplotlib cannot be loaded, drawing says so.
"""

import os
from contextlib import suppress
from importlib import import_module

with open(os.devnull, "r+b") as nowhere:
    for stream in range(3):
        os.dup2(nowhere.fileno(), stream)
with suppress(Exception):
    vars(import_module("matplotlib.artist"))["kwdoc"] = lambda _: ""
