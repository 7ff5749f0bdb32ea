"""Runs in Python that fail on the way: what they leave."""

from functools import cache

import pytest

from patchlaw.multiscale import Problem, Run, Scene, run
from patchlaw.support import NotConverged

SPECTRUM = {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.2, "seed": 3}
BLOCK = {"height": 1.0, "young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [6, 6, 4]}


def scene(kind):
    laws = {"table_tolerance": 0.05} if kind == "consistent" else {}
    return Scene.from_dict({
        "surface": {"spectrum": SPECTRUM, "grid": [24, 24], "lengths": [1.0, 1.0]}, "block": BLOCK,
        "coupling": {"kind": kind} | laws, "load": {"approach": 0.006, "steps": 3},
        "output": {"check": "none"},
    })  # fmt: skip


@cache
def forces(kind):
    """Return the forces of the run that does not fail."""
    return run(scene(kind)).force_N.tolist()


@pytest.mark.parametrize(
    ("kind", "accepted"), [("analytic", 0), ("analytic", 2), ("concurrent", 2), ("consistent", 2)]
)
def test_a_failed_run_gives_the_steps_before_and_closes(monkeypatch, kind, accepted):
    """The load steps are those of a run that does not fail."""
    whole, closed = forces(kind), []
    steps, close = Problem.steps, Run.close

    def failing(problem):
        for k, step in enumerate(steps(problem)):
            if k == accepted:
                raise NotConverged("a load step", reason="TEST", iterations=7, remedy="none")
            yield step

    monkeypatch.setattr(Problem, "steps", failing)
    monkeypatch.setattr(Run, "close", lambda self: [closed.append(1), close(self)])
    with pytest.raises(NotConverged, match="TEST after 7 iterations") as failure:
        run(scene(kind))
    found = failure.value.history
    assert [step.force_N for step in found.steps] == whole[:accepted]
    # as on the command line, the contact of the last load step is there
    recorded = [accepted] if accepted and kind != "consistent" else []
    assert [one.step for one in found.contact_records] == recorded
    assert closed == [1]


def test_a_run_closes_when_its_observer_fails(monkeypatch):
    closed = []
    monkeypatch.setattr(Run, "close", lambda self: closed.append(1))
    with pytest.raises(ZeroDivisionError):
        run(scene("analytic"), observe=lambda _: 1 / 0)
    assert closed == [1]
