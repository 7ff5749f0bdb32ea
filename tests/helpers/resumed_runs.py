"""Runs that leave a checkpoint on their way, and runs that go on from it."""

from patchlaw.multiscale import Run
from patchlaw.multiscale.runs.output.results_folder import read_checkpoint
from patchlaw.support.files import write_record


def ran_past(scene, step, path):
    """Return the whole run of a scene, which wrote a checkpoint after one of its load steps."""
    whole = Run(scene)
    for each in whole.load_steps():
        if each.step == step:
            write_record(path, whole.checkpoint(whole.coupling.state()))
    return whole


def gone_on(scene, path):
    """Return the run of a scene from a checkpoint to its end, and the load steps of its own."""
    kept, again = read_checkpoint(path), Run(scene)
    again.resume(kept)
    return again, list(again.load_steps())
