"""Units that are not among the common ones."""

import os
import struct
import subprocess
import sys

import pytest

SIZES = "import patchlaw.support.quantities as q; print(q.parse_quantity('0.02 inch', 'mm'))"


def size_of_an_inch(root, home):
    done = subprocess.run(
        [sys.executable, "-c", SIZES], cwd=root, capture_output=True, text=True, check=True,
        env=os.environ | {"XDG_CACHE_HOME": str(home)}, timeout=60,
    )  # fmt: skip
    return float(done.stdout)


@pytest.mark.slow
def test_units_are_read_from_no_cache(root, tmp_path):
    """Pickles in a cache are run by whoever loads them, and pint believes their numbers."""
    import pint

    pint.UnitRegistry(cache_folder=tmp_path / "pint")
    yards = [struct.pack(">d", size) for size in (0.9144, 0.9999)]
    damaged = 0
    for path in tmp_path.rglob("*.pickle"):
        content = path.read_bytes()
        damaged += content.count(yards[0])
        path.write_bytes(content.replace(*yards))
    before = sorted(tmp_path.rglob("*"))
    assert abs(size_of_an_inch(root, tmp_path) - 0.508) < 1e-15  # an inch is 25.4 mm
    assert sorted(tmp_path.rglob("*")) == before and damaged
