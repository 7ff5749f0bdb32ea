"""Faces under laws that run in against cells of the same map on the same block."""

import pytest

from benchmarks.wear_of_laws import worn


@pytest.mark.long  # laws of worn samples on quadratic elements: 10 s
def test_a_face_under_laws_runs_in_as_its_cells():
    """As exact after it has worn as before: edges of the block, which laws of samples neglect."""
    slid = (3e4, 3e5)
    cells, laws = (worn(kind, 32, slid) for kind in ("concurrent", "representative"))
    for name, share in (
        ("approach_mm", 0.015),
        ("contact_area_fraction", 0.1),
        ("mean_separation_mm", 0.1),
        ("interface_stiffness_N_per_mm", 0.15),
        ("worn_volume_mm3", 1e-9),
    ):
        true = getattr(cells, name)
        assert getattr(laws, name) == pytest.approx(true, rel=share), name
    assert cells.contact_area_fraction[-1] > 5.0 * cells.contact_area_fraction[0]
