"""Long runs: memory does not grow with the number of load steps, runs go on, and are freed."""

import gc
import tracemalloc

import pytest

from patchlaw.multiscale import Run, Scene

SURFACE = {
    "spectrum": {"hurst": 0.9, "waves": [2, 6], "rms_slope": 0.1, "seed": 2},
    "grid": [16, 16],
    "lengths": [1.0, 1.0],
}
CASES = {
    "summits": {"micro": {"model": "elliptic"}},
    "hardness": {"micro": {"model": "half-space", "hardness": 300.0}},
}
PRESSED_AND_SHEARED = {"force": 1.0, "shear_force": [0.1, 0.0], "steps": 2}


def cyclic(changes, cycles):
    """Return a small scene that goes up and down; both turning points are one step away."""
    data = {
        "surface": SURFACE,
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": "analytic"},
        "load": {"approach": [3e-3, 2e-3], "steps": 2, "cycles": cycles},
        "output": {"check": "none"},
    }
    return Scene.from_dict(data | changes)


class Latest(list):
    """Load steps of which the latest alone is kept: what grows beside them shows."""

    def append(self, step):
        self[:] = [step]


def after_steps(run, numbers, measure):
    """Return what is measured after some load steps of a run."""
    found = {}
    for step in run.load_steps():
        if step.step in numbers:
            found[step.step] = measure()
    return [found[number] for number in numbers]


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param(CASES["summits"], id="summits"),
        pytest.param(CASES["hardness"], id="hardness", marks=pytest.mark.long),
    ],
)
def test_memory_grows_by_the_history_alone(changes):
    run = Run(cyclic(changes, 25))
    run.steps = Latest()

    def alive():
        gc.collect()
        return len(gc.get_objects()), tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        (objects, first), (objects_later, later) = after_steps(run, (25, 100), alive)
    finally:
        tracemalloc.stop()
    assert objects_later - objects < 10
    # a row has 1500 bytes and more, a map 2000; numpy keeps small blocks, up to 210 B a step here
    assert later - first < 75 * 400


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"micro": {"model": "half-space", "finite_slopes": True}, "output": {}},
        {"friction": {"coefficient": 0.3, "coupled": True}, "load": PRESSED_AND_SHEARED},
        {"micro": {"model": "elliptic"}},
    ],
    ids=["slopes", "friction", "summits"],
)
def test_a_run_is_freed_as_soon_as_it_is_dropped(changes):
    """Otherwise the cases of a sweep wait for the search for cycles, of 5 MB each and more."""
    gc.collect()
    gc.set_debug(gc.DEBUG_SAVEALL)
    try:
        steps = list(Run(cyclic(changes, cycles=1)).load_steps())
        assert len(steps) > 1
        del steps
        gc.collect()
        waiting = {type(each) for each in gc.garbage}
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
    ours = {"patchlaw", "numpy"}
    assert not [kind for kind in waiting if kind.__module__.partition(".")[0] in ours]
