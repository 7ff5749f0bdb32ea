"""Runs that are killed go on as if nothing had happened, on any number of ranks."""

import pytest
from helpers.mpi_environment import MPI_ENVIRONMENT

from benchmarks.killed_runs import Runs, campaign


@pytest.mark.slow
def test_eight_kills_change_nothing(tmp_path, root):
    """Two couplings here; the benchmark ``kill_campaign.py`` does all, any number of times."""
    runs, resumed = Runs(root, MPI_ENVIRONMENT), 0
    for scene in ("half-space alone, balanced", "on the mesh"):
        folder = tmp_path / scene.replace(" ", "_")
        folder.mkdir()
        worst, count = campaign(runs, scene, 4, folder, seed=1, every=2)
        # nothing but the tolerance of the Newton iteration on the mesh, and the ranks' rounding
        assert worst <= 1e-10, scene
        resumed += count
    assert resumed  # not all kills came before the first step
