"""Comparisons of any scenes whose configurations end in any way."""

import random
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import strategies as st
from multiscale.comparison import AGAINST
from multiscale.comparison.compare import compare
from multiscale.comparison.configuration import Curves, RunResult

from geometry.patches import PatchGrid
from helpers.scene_inputs import scenes, takes_long
from multiscale.cli.compare import comparison_html
from multiscale.scene.scene import Scene
from multiscale.storage import write_csv
from support.errors import InputError, NotConverged

STATUSES = ("done", "done", "done", "not converged", "refused", "failed", "over budget")
SIZES = (0.0, 1.0, 1.0, 1.0, 1e-30, 1e30)

asked = st.tuples(
    scenes(), st.integers(0, 2**32), st.sampled_from([*[None] * 4, *AGAINST, "anything"])
)


def ended(dice, configuration, seconds):
    """Return how a configuration may end: well, early or badly, with odd numbers."""
    status, load_history = dice.choice(STATUSES), configuration.scene.loading.load_history
    whole = len(load_history.targets)
    steps = np.arange(1.0, 1.0 + (whole if status == "done" else dice.randrange(whole)))
    patches = PatchGrid(grid=configuration.scene.patches.grid, lengths=(1.0, 1.0))
    numbers = {
        name: dice.choice(SIZES) * dice.uniform(0.5, 1.5) * steps
        for name in ("approach", "force", "area", "separation")
    }
    bar = dice.choice([0.0, 0.01, np.nan])
    curves = Curves(
        patches=patches,
        patch_pressure=np.outer(numbers["force"], np.ones(patches.count)),
        **numbers,
        **{f"{name}_error": bar * numbers[name] for name in ("approach", "force", "area")},
    )
    return RunResult(
        configuration=configuration,
        status=status,
        exit_code=dice.choice([0, 2, 3, -9, None]),
        message=dice.choice(["", "told <b>why</b>\nin two lines"]),
        phases=dice.choice([{}, {"laws": 0.5, "load steps": 1.0}, {"surface": 0.0}]),
        start_s=dice.uniform(0.0, 1.0),
        cpu_s=dice.choice([0.0, 1.0]),
        curves=curves,
        finite_slopes=dice.choice([True, True, False]),
    )


def compared(path, number, against=None):
    """Compare the configurations of a scene, all but their runs; return how that ended."""
    launch = partial(ended, random.Random(number))
    try:
        scene = Scene.load(path)
        if takes_long(scene):
            return "not tried"
        with TemporaryDirectory(dir=path.parent) as folder:
            kept = path.parent / folder
            found = compare(scene, against=against, launch=launch, folder=kept)
            again = compare(scene, against=against, launch=launch, folder=kept)
            assert len(again) == len(found)
            columns = found.to_dict()
            write_csv(kept / "a.csv", list(columns), zip(*columns.values(), strict=True))
        page = comparison_html(found, {})
        assert "<b>why" not in page
    except InputError as error:
        told = str(error)
        assert str(path) in told or error.key == "surface.file" or error.value == against, told
        return "refused"
    except NotConverged:
        return "not converged"
    return "compared"
