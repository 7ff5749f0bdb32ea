"""What the script beside a test file finds on every number of ranks."""

import pytest
from helpers.on_ranks import OnRanks


@pytest.fixture(scope="module")
def on_ranks(request, waiting_ranks):
    """Return what `x_script.py` found, by the number of ranks, to the tests in `test_x.py`."""
    name = request.path.stem.removeprefix("test_")
    return OnRanks(waiting_ranks, f"{name}_script.py")
