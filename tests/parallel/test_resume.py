"""Runs that are killed go on as if nothing had happened, on any number of ranks."""

import pytest
from conftest import MPI_ENVIRONMENT
from killed_runs import SCENES, campaign


@pytest.mark.parametrize("scene", SCENES)
def test_twenty_kills_change_nothing(tmp_path, root, scene):
    """Five kills of each scene; see the benchmark ``kill_campaign.py`` for any number."""
    worst, resumed = campaign(
        scene, 5, tmp_path, seed=scene, environment=MPI_ENVIRONMENT, root=root
    )
    assert worst <= 1e-10
    assert resumed
