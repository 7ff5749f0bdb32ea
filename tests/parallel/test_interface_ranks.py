"""Rough interfaces in a user's problem on 1 to 3 ranks: the block's own forces, everywhere."""

import pytest

RANKS = [1, 2, pytest.param(3, marks=pytest.mark.slow)]


@pytest.mark.parametrize("ranks", RANKS)
def test_user_code_gives_the_blocks_force_on_any_ranks(on_ranks, ranks):
    one = on_ranks[1]["values"]
    for name, (force, apart, pressures) in on_ranks[ranks]["values"].items():
        assert abs(apart) < 1e-10, name
        assert pressures < 1e-8, name
        assert force == pytest.approx(one[name][0], rel=2e-10), name


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_may_have_no_facets(on_ranks, ranks):
    found = on_ranks[ranks]
    assert len(found["facets"]) == ranks
    if ranks > 2:
        assert min(found["facets"]) == 0
    (force, _), (assembled, _) = found["bar"].values()
    assert force == pytest.approx(assembled, rel=1e-9)
    assert force == pytest.approx(on_ranks[1]["bar"]["bar False"][0], rel=1e-9)
    assert all(abs(apart) < 1e-8 for _, apart in found["bar"].values())


@pytest.mark.parametrize("ranks", RANKS)
def test_what_slips_is_the_same_on_any_ranks(on_ranks, ranks):
    one = on_ranks[1]["rubbed"]
    assert one["pointwise 2"][:2] == pytest.approx([-0.2, 0.3], rel=1e-10)
    for name, values in on_ranks[ranks]["rubbed"].items():
        largest = max(map(abs, one[name][:2]))
        assert values[:2] == pytest.approx(one[name][:2], abs=1e-8 * max(largest, 0.1)), name
        assert values[2:] == pytest.approx(one[name][2:], rel=1e-8, abs=1e-13), name


@pytest.mark.parametrize("ranks", RANKS)
def test_what_wears_is_the_same_on_any_ranks(on_ranks, ranks):
    for name, values in on_ranks[ranks]["worn"].items():
        assert values[4] == pytest.approx(1e-6 * 3.0 * 450.0, rel=1e-10), name
        # slopes of the plane times its half side are compared with its approach
        near = 1e-8 * abs(values[1])
        assert values == pytest.approx(on_ranks[1]["worn"][name], rel=1e-8, abs=near), name


@pytest.mark.parametrize("ranks", RANKS)
def test_all_ranks_refuse_together(on_ranks, ranks):
    errors = on_ranks[ranks]["errors"]
    assert errors == [errors[0]] * ranks
    assert "has no facets" in errors[0][0]
    assert "are not in the mesh" in errors[0][1]


@pytest.mark.parametrize("ranks", RANKS)
def test_a_face_leaks_the_same_on_any_ranks(on_ranks, ranks):
    for name, (values, imbalance) in on_ranks[ranks]["leaks"].items():
        assert values == pytest.approx(on_ranks[1]["leaks"][name][0], rel=1e-8), name
        assert min(values) > 0.0 and len(set(values)) == len(values)
        assert imbalance < 1e-10, name


@pytest.mark.parametrize("ranks", RANKS)
def test_two_bodies_on_any_ranks(on_ranks, ranks):
    for made in ("opposite", "joined"):  # of one mesh, or of two
        values, reaction = on_ranks[ranks][made]
        # across the way that the pad moves nothing shears it but for rounding
        small = 1e-8 * values[0]
        assert values == pytest.approx(on_ranks[1]["opposite"][0], rel=1e-8, abs=small)
        assert max(map(abs, reaction)) < 1e-7 * values[0]


@pytest.mark.parametrize("ranks", RANKS)
def test_plane_turned_and_mixed_problems_on_any_ranks(on_ranks, ranks):
    for name, values in on_ranks[ranks]["plane"].items():
        one = on_ranks[1]["plane"][name]  # with zeros but for rounding: N, N mm
        assert values == pytest.approx(one, rel=1e-8, abs=1e-10), name
