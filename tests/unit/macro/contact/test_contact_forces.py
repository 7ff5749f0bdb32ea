"""First touch of laws that only tell whether they are in contact."""

import pytest

from patchlaw import NotConverged
from patchlaw.geometry import Control
from patchlaw.macro.contact.pressed_plane import first_touch

NO_FORCE = Control(force=0.0)


@pytest.mark.parametrize("at", [-3.0, -1e-9, 0.0, 1e-12, 0.25, 40.0])
def test_first_touch_is_found_to_rounding(at):
    found = first_touch(lambda approach: approach > at, NO_FORCE, 1.0)
    assert found == pytest.approx(at, rel=1e-15, abs=1e-300)


def test_nothing_to_touch():
    with pytest.raises(NotConverged, match=r"NO_CONTACT .*no patch can be touched"):
        first_touch(lambda _approach: False, NO_FORCE, 1.0)
