"""Sliders: return mapping against small steps of many springs, tangents, energy, loops, turns."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import fsolve

from patchlaw.geometry.sliders import Sliders
from patchlaw.geometry.spring_bed import SpringBed, springs_of

MU, RATIO, TOUCH, END = 0.37, 1.23, 0.4e-3, 7e-3


def pressure(closure):
    return 611.0 * np.maximum(closure - TOUCH, 0.0) ** 1.7


def rate(closure):
    return 1.7 * 611.0 * np.maximum(closure - TOUCH, 0.0) ** 0.7


def sliders_of(coupling):
    bed = springs_of(pressure, rate, TOUCH, END, coupling=lambda c: np.full_like(c, coupling))
    return Sliders([bed], np.array([RATIO]), np.zeros(1, int), MU)


@pytest.fixture(scope="module", params=[0.0, 0.6, 0.9])
def sliders(request):
    return sliders_of(request.param)


def step(sliders, before, closure, slip):
    c = np.array([closure])
    found = sliders.respond(before, c, np.array([slip], float), pressure(c), rate(c))
    return SimpleNamespace(**found._asdict(), **sliders.step(before, found)._asdict())


def walk(sliders, path):
    """Responses along a path of (closure, slip x, slip y)."""
    found, state = [], sliders.at_rest
    for closure, *slip in path:
        found.append(step(sliders, state, closure, slip))
        state = found[-1].after
    return found


def fine_springs(path, count=4000, parts=40):
    """Slow oracle: many springs, each with its slider, in small steps along straight ways."""
    touch = TOUCH + (END - TOUCH) * (np.arange(count) + 0.5) / count
    edges = TOUCH + (END - TOUCH) * np.arange(count + 1) / count
    k = np.diff(rate(edges))
    stress, at, forces = np.zeros((count, 2)), np.array([TOUCH, 0.0, 0.0]), []
    for target in np.asarray(path, float):
        for share in np.arange(1, parts + 1) / parts:
            now = at + share * (target - at)
            before = at + (share - 1.0 / parts) * (target - at)
            stress += (k * (now[0] > touch))[:, None] / RATIO * (now[1:] - before[1:])
            bound = MU * k * np.maximum(now[0] - touch, 0.0)
            size = np.hypot(*stress.T)
            stress *= np.where(size > bound, bound / np.maximum(size, 1e-300), 1.0)[:, None]
        at = target
        forces.append(stress.sum(axis=0))
    return np.array(forces)


def scaled(*points):
    """Closures and slips, the latter in parts of that of full sliding at the largest closure."""
    return [(c * END, x * MU * RATIO * END, y * MU * RATIO * END) for c, x, y in points]


PATHS = {
    "shear": scaled((0.9, 0, 0), (0.9, 0.2, 0), (0.9, 0.5, 0), (0.9, 0.8, 0)),
    "back": scaled((0.9, 0, 0), (0.9, 0.6, 0), (0.9, 0.1, 0), (0.9, -0.5, 0), (0.9, 0.6, 0)),
    "turn": scaled((0.9, 0, 0), *((0.9, 0.45, 0.045 * k) for k in range(11))),
    "unload": scaled(
        (0.9, 0, 0), (0.9, 0.3, 0), (0.6, 0.3, 0), (0.4, 0.3, 0), (0.9, 0.3, 0), (0.9, 0.4, 0)
    ),
}


LINES = [name for name in PATHS if name != "turn"]


@pytest.mark.parametrize("name", LINES)
def test_few_springs_in_large_steps_are_many_in_small_ones(sliders, name):
    found = np.array([each.stress[0] for each in walk(sliders, PATHS[name])])
    exact = fine_springs(PATHS[name])
    # 35 springs: 0.1 % of the bound each way
    assert found == pytest.approx(exact, abs=0.003 * MU * float(pressure(0.9 * END)))


def turned(coupling, closure, path, count=1500):
    """Slow oracle: many springs that give way by s − r C τ together, along slips (n, 2)."""
    edges = TOUCH + (closure - TOUCH) * np.arange(count + 1) / count
    behind = coupling / float(rate(closure))
    k = np.diff(rate(edges) / (1.0 - behind * rate(edges)))
    at = edges - behind * pressure(edges)
    bound = MU * k * (at[-1] - 0.5 * (at[1:] + at[:-1]))
    stress, before, forces = np.zeros((count, 2)), np.zeros(2), []

    def after(own):
        trial = stress + k[:, None] / RATIO * (own - before)
        return trial * np.minimum(1.0, bound / np.maximum(np.hypot(*trial.T), 1e-300))[:, None]

    for slip in np.asarray(path, float):
        own = END * fsolve(
            lambda own, to=slip: own + (RATIO * behind * after(END * own).sum(axis=0) - to) / END,
            before / END,
        )
        stress, before = after(own), own
        forces.append(stress.sum(axis=0))
    return np.array(forces)


@pytest.mark.parametrize("coupling", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("part", [0.9, 0.5])
def test_turns_are_those_of_many_springs_with_a_compliance_in_common(coupling, part):
    angles = np.linspace(0.0, 5.0, 31)
    amplitude = 0.6 * MU * RATIO * (part * END - TOUCH)
    path = amplitude * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    found = walk(sliders_of(coupling), [(part * END, 0, 0), *((part * END, *s) for s in path)])
    exact = turned(coupling, part * END, path)
    bound = MU * float(pressure(part * END))
    assert np.hypot(*exact.T).max() > 0.7 * bound
    # 0.1 % of the bound by the number of springs, of both lags of a turn
    assert np.array([each.stress[0] for each in found[1:]]) == pytest.approx(
        exact, abs=0.004 * bound
    )


def test_what_springs_have_in_common_changes_nothing_along_lines():
    rng = np.random.default_rng(6)
    closures, slips = END * rng.uniform(0.2, 1.0, 60), MU * END * rng.normal(size=60)
    direction = np.array([0.6, 0.8])
    path = [(c, *(0.5 * s * direction)) for c, s in zip(closures, slips, strict=True)]
    alone, coupled = (
        np.array([each.stress[0] for each in walk(sliders_of(coupling), path)])
        for coupling in (0.0, 0.9)
    )
    assert np.abs(alone).max() > 0.8 * MU * float(pressure(0.8 * END))
    # groups of springs are seen by their ends and means; 1e-4 with 35 groups, 2e-6 with 120
    assert coupled == pytest.approx(alone, abs=3e-4 * MU * float(pressure(END)))


def test_what_springs_lose_is_continuous_where_they_part(sliders):
    """Just before the law parts, few springs bear 1e-6 of its pressure of then: what they bore."""
    until = scaled((0.9, 0, 0), (0.9, 0.4, 0))
    lost = [
        float(walk(sliders, [*until, (TOUCH + above, -END, 0.0)])[-1].lost[0])
        for above in (-1e-9, 1e-9, 1e-12)
    ]
    assert lost[0] > 0.0
    assert lost[1:] == pytest.approx([lost[0]] * 2, rel=1e-5)  # 6e-6 at a closure of 1e-9 mm


def test_full_sliding_is_the_coefficient_times_the_pressure(sliders):
    *_, last = walk(sliders, scaled((0.8, 0, 0), (0.8, 3.0, 4.0)))
    bound = MU * float(pressure(0.8 * END))
    assert last.stress[0] == pytest.approx([0.6 * bound, 0.8 * bound], rel=1e-13)
    assert last.stick_closure[0] == pytest.approx(TOUCH)


def test_sticking_springs_are_as_stiff_as_the_law_over_mindlins_ratio(sliders):
    first, last = walk(sliders, scaled((0.8, 0, 0), (0.8, 1e-9, 0)))
    law = float(rate(0.8 * END)) / RATIO
    assert last.by_slip[0] == pytest.approx(law * np.eye(2), rel=5e-3)  # lines between the nodes
    assert first.stick_closure[0] == pytest.approx(0.8 * END, rel=1e-9)


def test_what_sticks_is_the_law_at_the_lower_load(sliders):
    """Ciavarella and Jäger: cells stick that would be in contact at the closure c − s/(μ r)."""
    slip = 0.3 * MU * RATIO * END
    *_, last = walk(sliders, [(0.9 * END, 0, 0), (0.9 * END, slip, 0)])
    groups = END / len(springs_of(pressure, rate, TOUCH, END))
    assert last.stick_closure[0] == pytest.approx(0.6 * END, abs=2.0 * groups)


@pytest.mark.parametrize("coupling", [0.0, 0.6])
def test_tangents_are_the_derivatives(coupling):
    bed = springs_of(pressure, rate, TOUCH, END, coupling=lambda c: np.full_like(c, coupling))
    sliders = Sliders([bed] * 50, np.full(50, RATIO), np.arange(50), MU)
    rng = np.random.default_rng(3)
    closures, slips = END * rng.random((2, 50)), MU * END * rng.normal(size=(2, 50, 2))

    def at(before, closure, slip):
        return sliders.respond(before, closure, slip, pressure(closure), rate(closure))

    rest = sliders.at_rest
    before = sliders.step(rest, at(rest, closures[0], slips[0])).after
    found, width = at(before, closures[1], slips[1]), 1e-8 * END
    for k, axis in enumerate(np.eye(2)):
        ahead, behind = (at(before, closures[1], slips[1] + w * axis) for w in (width, -width))
        change = (ahead.stress - behind.stress) / (2.0 * width)
        scale = float(rate(END)) / RATIO
        assert found.by_slip[:, :, k] == pytest.approx(change, abs=1e-5 * scale)
    ahead, behind = (at(before, closures[1] + w, slips[1]) for w in (width, -width))
    change = (ahead.stress - behind.stress) / (2.0 * width)
    # what springs have in common counts as unchanging; at turns it changes as they touch
    close = 1e-3 if coupling else 1e-5
    assert found.by_closure == pytest.approx(change, abs=close * float(rate(END)))
    assert np.abs(found.by_closure).max() > 0.1 * MU * float(rate(END))


def test_samples_answer_alike_in_any_company(sliders):
    """Some rows alone, and so many that they are worked on in several parts."""
    bed = springs_of(pressure, rate, TOUCH, END)
    many = Sliders([bed, bed], np.array([RATIO, 2.0]), np.repeat([0, 1], 700), MU)
    rng = np.random.default_rng(4)
    closures, slips = END * rng.uniform(-0.2, 1.0, (2, 1400)), MU * END * rng.normal(size=(1400, 2))

    def at(before, closure, slip, **rows):
        return many.respond(before, closure, slip, pressure(closure), rate(closure), **rows)

    before = many.step(many.at_rest, at(many.at_rest, closures[0], slips)).after
    whole, rows = at(before, closures[1], -slips), np.sort(rng.choice(1400, 40, replace=False))
    some = at(before, closures[1][rows], -slips[rows], rows=rows)
    one = [at(before, closures[1][[k]], -slips[[k]], rows=np.array([k])) for k in rows]
    assert np.abs(whole.stress).max() > 0.5 * MU * float(pressure(END))
    for name in ("stress", "by_slip", "by_closure", "sticking"):
        expected = getattr(whole, name)[rows]
        close = 1e-13 * np.abs(expected).max()  # sums over more or fewer springs that do not touch
        np.testing.assert_allclose(getattr(some, name), expected, atol=close)
        alone = np.concatenate([getattr(each, name) for each in one])
        np.testing.assert_allclose(alone, expected, atol=close)


@pytest.mark.long
def test_nothing_gains_energy_on_any_path(sliders):
    rng = np.random.default_rng(8)
    path = np.column_stack([END * rng.random(400), MU * END * rng.normal(size=(400, 2))])
    lost = np.array([each.lost[0] for each in walk(sliders, path)])
    assert lost.min() >= 0.0
    assert np.count_nonzero(lost) > 390


def test_a_loop_closes_and_loses_its_area(sliders):
    amplitude = 0.5 * MU * RATIO * END
    parts = np.concatenate([np.linspace(1, -1, 81), np.linspace(-1, 1, 81)[1:]])
    path = [(0.9 * END, 0, 0), *((0.9 * END, amplitude * part, 0) for part in parts)]
    found = walk(sliders, path)[1:]
    assert found[-1].stress == pytest.approx(found[0].stress, rel=1e-12)
    assert found[80].stress == pytest.approx(-found[0].stress, rel=1e-12, abs=1e-12)  # Masing
    force = np.array([each.stress[0, 0] for each in found])
    area = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(amplitude * parts)))
    # the trapezoidal rule cuts corners, and small steps sum up their own slips
    assert sum(float(each.lost[0]) for each in found[1:]) == pytest.approx(area, rel=3e-3)


def test_springs_that_part_lose_their_energy(sliders):
    held = (0.8 * END, 0.2 * MU * RATIO * END, 0)
    pressed, sheared, parted = walk(sliders, [(0.8 * END, 0, 0), held, (0.0, *held[1:])])
    assert parted.stress == pytest.approx(np.zeros((1, 2)))
    work, before = 0.0, pressed.after
    for share in (np.arange(200) + 1.0) / 200.0:  # work of the shear until then
        now = step(sliders, before, held[0], (share * held[1], 0.0))
        work += float(now.stress[0, 0]) * held[1] / 200.0
        before = now.after
    # all of it is lost at the end: sliding first, and then what the springs stored
    assert float(sheared.lost[0] + parted.lost[0]) == pytest.approx(work, rel=0.02)


def test_sliders_go_on_under_a_law_that_goes_further(sliders):
    longer = Sliders(
        [springs_of(pressure, rate, TOUCH, 1.6 * END)], np.array([RATIO]), np.zeros(1, int), MU
    )
    path = scaled((0.9, 0, 0), (0.9, 0.4, 0.1), (0.8, 0.2, 0.3))
    last, same = walk(sliders, path)[-1], walk(longer, path)[-1]
    moved = longer.following(sliders, last.after)
    bound = MU * float(pressure(0.9 * END))
    assert moved.stress.sum(axis=2) == pytest.approx(
        last.after.stress.sum(axis=2), abs=0.01 * bound
    )
    assert moved.stress.sum(axis=2) == pytest.approx(
        same.after.stress.sum(axis=2), abs=0.01 * bound
    )


def test_all_sticks_where_no_further_springs_touch():
    """The stiffness of a law is a constant there, and springs sum up to it but for rounding."""
    rng = np.random.default_rng(11)
    width = rng.uniform(0.1e-3, 0.3e-3, 23)
    start = np.cumsum(width + rng.uniform(0.1e-3, 0.3e-3, 23)) - width
    bed = SpringBed(start=start, width=width, stiffness=rng.uniform(10.0, 3000.0, 23), coupling=0.4)
    closure = 0.5 * (start[1:] + start[:-1] + width[:-1])
    one = np.zeros(22, int)
    sliders = Sliders([bed], np.array([RATIO]), one, MU)
    slip = np.column_stack([1e-9 + 0.0 * closure, 0.0 * closure])
    normal = bed.pressure(closure), np.full(22, 1e3)
    pressed = sliders.respond(sliders.at_rest, closure, 0.0 * slip, *normal)
    before = sliders.step(sliders.at_rest, pressed).after
    after = sliders.step(before, sliders.respond(before, closure, slip, *normal))
    assert after.stick_closure == pytest.approx(closure, rel=1e-12)


def test_springs_that_touch_before_the_law_bears_anything_go_on(sliders):
    path, state = [(0.5, 0.1), (0.5, 0.4), (0.9, 0.4), (0.9, 0.3)], sliders.at_rest
    for share, way in path:
        c, slip = np.array([share * END]), np.array([[way * MU * RATIO * END, 0.0]])
        p = pressure(c) if share > 0.5 else np.zeros(1)
        found = sliders.respond(state, c, slip, p, rate(c))
        step = sliders.step(state, found)
        state = step.after
        assert np.isfinite(state.stress).all()
        assert 0.0 <= step.lost[0] < np.inf
        assert np.hypot(*found.stress[0]) <= MU * p[0] + 1e-9
    assert np.hypot(*found.stress[0]) > 0.1 * MU * p[0]
