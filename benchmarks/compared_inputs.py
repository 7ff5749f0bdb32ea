"""Comparisons of any scenes whose configurations end in any way."""

import random
from functools import partial
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from hypothesis import strategies as st

from benchmarks.scene_inputs import scenes, takes_long
from patchlaw.multiscale import Scene, compare
from patchlaw.multiscale.cli.studies import comparison_html
from patchlaw.multiscale.results.files import table_files
from patchlaw.multiscale.runs import AGAINST, comparison
from patchlaw.multiscale.runs.cases import CaseResult
from patchlaw.support import InputError, NotConverged

STATUSES = ("done", "done", "done", "not converged", "refused", "failed", "not started")
SIZES = (0.0, 1.0, 1.0, 1.0, 1e-30, 1e30)

asked = st.tuples(
    scenes(), st.integers(0, 2**32), st.sampled_from([*[None] * 4, *AGAINST, "anything"])
)


def ended(dice, configuration, progress):
    """Return how a configuration may end: well, early or badly, with odd numbers."""
    status, load_history = dice.choice(STATUSES), configuration.scene.loading
    whole = load_history.count
    steps = np.arange(1.0, 1.0 + (whole if status == "done" else dice.randrange(whole)))
    patches = configuration.scene.patches.grid
    numbers = {
        name: dice.choice(SIZES) * dice.uniform(0.5, 1.5) * steps
        for name in ("approach", "force", "area", "separation")
    }
    bar = dice.choice([0.0, 0.01, np.nan])
    numbers |= {f"{name}_error": bar * numbers[name] for name in ("approach", "force", "area")}
    pressure = np.outer(numbers["force"], np.ones(patches[0] * patches[1]))
    measured = {
        "seconds": dice.choice([0.0, 1.5]),
        "finite_slopes": dice.choice([True, True, False]),
    }
    return CaseResult(
        status=status,
        failure=dice.choice(["", "told <b>why</b>\nin two lines"]),
        measured=measured,
        arrays=numbers | {"patch_pressure": pressure, "patches": np.array(patches)},
    )


def compared(path, number, against=None):
    """Compare the configurations of a scene, all but their runs; return how that ended."""
    solve = partial(ended, random.Random(number))
    try:
        scene = Scene.load(path)
        if takes_long(scene):
            return "not tried"
        ways = patch.object(comparison, "solved", solve)
        with TemporaryDirectory(dir=path.parent) as folder, ways:
            kept = path.parent / folder
            found = compare(scene, against=against, folder=kept)
            again = compare(scene, against=against, folder=kept)
            assert len(again) == len(found)
            assert dict(table_files({"a": found.records()}))
        page = comparison_html(found, {})
        assert "<b>why" not in page
    except InputError as error:
        told = str(error)
        assert str(path) in told or error.key == "surface.file" or error.value == against, told
        return "refused"
    except NotConverged:
        return "not converged"
    return "compared"
