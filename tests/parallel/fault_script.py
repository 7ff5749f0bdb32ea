"""Runs the command line with something going wrong on one rank; see `test_faults.py`."""

import os
import resource
import signal
import sys
import time
from importlib import import_module
from itertools import count

from mpi4py import MPI

from patchlaw.multiscale import PatchContact
from patchlaw.multiscale.cli import main
from patchlaw.support import NotConverged

command = import_module("patchlaw.multiscale.cli.run")
run = import_module("patchlaw.multiscale.runs.scene_run")
PLACES = {
    "surface": (sys.modules["patchlaw.multiscale.models.setup"], "on_root_alone"),
    "load step": (PatchContact, "press"),
    "checkpoint": (command.CheckpointWriter, "accept"),
    "output": (command, "write_fields"),
    "writing on rank 0": (command, "write_results"),
}


def bug(*arguments, **more):
    raise RuntimeError("something broke")


def one_sided(*arguments):
    raise NotConverged("one rank alone", reason="DIVERGED", iterations=1, remedy="none")


def signalled(self, step=None):
    """Send a signal to this rank alone."""
    accept(self, step)
    if next(accepted) == 2:
        os.kill(os.getpid(), signal.SIGUSR1)


def slow(self, control):
    """Make load steps last."""
    time.sleep(0.3)
    return press(self, control)


def full(folder, run):
    """Let no file grow beyond what stands for a full disk on this rank."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, resource.RLIM_INFINITY))
    return write_fields(folder, run)


accept, press = command.CheckpointWriter.accept, PatchContact.press
write_fields = command.write_fields
accepted = count(0)  # the first call is made before any load step
rank, what, place, *words = int(sys.argv[1]), *sys.argv[2:]
if MPI.COMM_WORLD.rank == rank:
    actions = {"bug": bug, "one-sided": one_sided, "signal": signalled, "slow": slow, "full": full}
    module, name = PLACES[place]
    assert hasattr(module, name), f"nothing is called {name} there any more"
    setattr(module, name, actions[what])
sys.exit(main(words))
