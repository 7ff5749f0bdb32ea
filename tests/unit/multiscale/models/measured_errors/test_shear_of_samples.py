"""Errors of shear under laws of samples: paths that go on, and what load steps before have lost."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw.multiscale.models.measured_errors import shear_of_samples
from patchlaw.multiscale.models.measured_errors.shear_of_samples import LawShearProbe


def test_paths_on_cells_go_on_from_where_the_load_step_before_has_come(monkeypatch):
    pressed = []

    def gone(normal, friction, path, before):
        pressed.extend(path)
        return (before or "") + "".join(path)

    monkeypatch.setattr(shear_of_samples, "gone", gone)
    probe = SimpleNamespace(cells=SimpleNamespace(ends={}))
    paths = "a", "ab", "ac", "acd", "ace", "xce", "xce"
    ends = [LawShearProbe._gone(probe, "cells", None, None, list(path)) for path in paths]
    assert ends == list(paths)
    assert "".join(pressed) == "a" + "b" + "c" + "d" + "e" + "xce"


@pytest.mark.parametrize(("before", "there", "error"), [
    (0.0, 5.0, 1.0), (3.0, 4.2, 0.8), (3.0, 7.0, 4.0), (4.0, 4.0, 0.0), (3.999996, 4.000004, 0.004),
])  # fmt: skip
def test_energy_lost_in_earlier_load_steps_errs_by_the_same_part(before, there, error):
    shear = SimpleNamespace(dissipated=4.0)
    probe = SimpleNamespace(_shear=shear, before=SimpleNamespace(dissipated=before))
    # 1 of 4 where it is all of the last step, 0.2 of its 1 where that is one of four, at most all;
    # a step that loses a millionth tells a thousandth
    lost = LawShearProbe._lost(probe, SimpleNamespace(dissipated=there))
    assert abs(lost - 4.0) == pytest.approx(error)


@pytest.mark.parametrize(("shear", "part"), [(0.8, 0.05), (1e-17, 0.04)])
def test_points_tell_no_part_of_a_shear_that_is_none(shear, part):
    """A part of rounding would state metres, as load steps before the shear did."""
    finer = np.array([4.1, 1.05 * shear, 0.0])
    finer[1] += 1.6e-7 if shear < 1e-6 else 0.0
    probe = SimpleNamespace(
        _other=lambda name, make: nullcontext(name),
        _borne=lambda name: np.array([4.0, shear, 0.0]),
        _borne_on_finer=lambda: finer,
        step=SimpleNamespace(by_force=False),
        answer=np.array([4.0, 3e-4, 4e-4, 7e-6]),
    )
    found = LawShearProbe.by_points(probe)
    assert found == pytest.approx(np.array([0.1, *(part * probe.answer[1:])]))
