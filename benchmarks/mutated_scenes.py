"""Strategies for stored scene files with mutations of every kind, and for surfaces beside them."""

import tomllib
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from benchmarks.scene_inputs import BASE, KEYS, put, toml, value

STORED = sorted((Path(__file__).parents[1] / "demos" / "scenes").glob("*.toml"))
SMALL = {
    "surface.grid": [24, 24],
    "patches.grid": [2, 2],
    "load.steps": 2,
    "block.cells": [4, 4, 4],
    "surface.spectrum.waves": [2, 5],
}
deep = st.sampled_from([2, 60, 99, 101, 400, 5000])


def stored():
    """Return the contents of the stored scenes, made small, and of the base of all others."""
    found = [BASE]
    for path in STORED:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        for key, part in SMALL.items():
            data = put(data, key, part)
        data["surface"]["spectrum"].pop("waves_x", None)
        data["surface"]["spectrum"].pop("waves_y", None)
        found.append(data)
    return found


def places(data, path=()):
    """Yield the path of everything in nested dictionaries and lists."""
    inner = data.items() if isinstance(data, dict) else enumerate(data)
    for name, part in inner:
        yield (*path, name)
        if isinstance(part, dict | list) and part:
            yield from places(part, (*path, name))


def changed(data, path, change):
    """Return a copy in which what stands at a path is what a function makes of it; None removes."""
    if not path:
        return change(data)
    first, *rest = path
    inner = dict(data) if isinstance(data, dict) else list(data)
    new = changed(inner[first], rest, change)
    if new is None:
        del inner[first]
    else:
        inner[first] = new
    return inner


def nested(part, depth, kind):
    """Return something within many lists or dictionaries."""
    for _ in range(depth):
        part = [part] if kind == "list" else {"a": part}
    return part


def as_lines(data):
    """Return a scene as people write it: a line for each key, under headers of sections."""
    lines = []
    for name, part in data.items():
        if isinstance(part, dict):
            lines += [f"[{name}]", *toml(part).splitlines()]
        else:
            lines.insert(0, toml({name: part}).strip())
    return lines


@st.composite
def mutated_values(draw):
    """Draw a stored scene with values swapped, nested, doubled, removed or of another kind."""
    data = draw(st.sampled_from(stored()))
    for _ in range(draw(st.integers(1, 4))):
        known = list(places(data))
        if not known:
            break
        path, other = draw(st.sampled_from(known)), draw(st.sampled_from(known))
        found = data
        for name in other:
            found = found[name]
        new = draw(
            st.sampled_from(["value", "other", "gone", "list", "pair", "section", "key", "text"])
        )
        made = {
            "value": lambda old: draw(value),
            "other": lambda old, found=found: found,
            "gone": lambda old: None,
            "list": lambda old: nested(old, draw(st.sampled_from([1, 2, 60])), "list"),
            "pair": lambda old: [old, old],
            "section": lambda old: nested(old, draw(st.sampled_from([1, 2, 60])), "section"),
            "key": lambda old: draw(KEYS[draw(st.sampled_from(sorted(KEYS)))]),
            "text": lambda old: str(old)[:500],
        }[new]
        data = changed(data, path, made)
    return toml(data) if isinstance(data, dict) else ""


@st.composite
def mutated_lines(draw):
    """Draw a stored scene with lines doubled, moved, joined, cut, or nested out of all measure."""
    lines = as_lines(draw(st.sampled_from(stored())))
    for _ in range(draw(st.integers(1, 3))):
        at, to = (draw(st.integers(0, max(len(lines) - 1, 0))) for _ in range(2))
        kind = draw(
            st.sampled_from(["twice", "move", "join", "cut", "dots", "header", "brackets", "many"])
        )
        line = lines[at] if lines else ""
        if kind == "twice":
            lines.insert(to, line)
        elif kind == "move" and lines:
            lines.insert(to, lines.pop(at))
        elif kind == "join":
            lines[at : at + 2] = ["".join(lines[at : at + 2])]
        elif kind == "cut":
            lines[at : at + 1] = [line[: draw(st.integers(0, len(line)))]]
        elif kind == "dots":
            lines.insert(to, ".".join(["a"] * draw(deep)) + " = 1")
        elif kind == "header":
            sign = draw(st.sampled_from(["[{}]", "[[{}]]", "x = {{{} = 1}}"]))
            lines.insert(to, sign.format(".".join(["surface"] * draw(deep))))
        elif kind == "brackets":
            depth = draw(deep)
            lines.insert(to, "x = " + draw(st.sampled_from(["[", "{a="])) * depth)
        else:
            lines[to:to] = [f"k{i} = {i}" for i in range(draw(deep))]
    return "\n".join(lines)


mutated = st.one_of(mutated_values(), mutated_lines())

KINDS = ("flat", "steps", "one", "waves", "noise", "long", "ramp", "holes", "checkers")
SIZES = (1e-290, 1e-110, 1e-16, 1e-9, 1e-3, 1e-3, 1e-3, 1.0, 1e9, 1e200)


@st.composite
def heights(draw):
    """Draw heights of a small surface: flat, in steps, long, fine beyond measure, with holes."""
    shape = draw(st.sampled_from([(16, 16), (24, 20), (5, 4), (4, 150)]))
    kind, size = draw(st.sampled_from(KINDS)), draw(st.sampled_from(SIZES))
    dice = np.random.default_rng(draw(st.integers(0, 99)))
    x, y = np.meshgrid(*(np.arange(count) / count for count in shape), indexing="ij")
    found = {
        "flat": lambda: np.ones(shape),
        "steps": lambda: np.round(3 * dice.random(shape)),
        "one": lambda: (np.arange(x.size) == x.size // 2).reshape(shape).astype(float),
        "waves": lambda: np.cos(4 * np.pi * x) * np.cos(6 * np.pi * y),
        "noise": lambda: dice.normal(size=shape),
        "long": lambda: dice.random((shape[0], 1)) * np.ones(shape),
        "ramp": lambda: x + 2 * y,
        "holes": lambda: np.where(dice.random(shape) < 0.1, np.nan, dice.normal(size=shape)),
        "checkers": lambda: np.indices(shape).sum(axis=0) % 2.0,
    }[kind]()
    offset = draw(st.sampled_from([0.0, 0.0, 1.0, -1e6]))
    with np.errstate(over="ignore", invalid="ignore"):
        return size * found + offset


@st.composite
def surfaces(draw):
    """Draw heights and a small scene of any kind for them, but for the path of their file."""
    data = dict(BASE) | {"surface": {"lengths": draw(st.sampled_from([[1.0, 1.0], [2.0, 0.3]]))}}
    data = put(data, "surface.missing", draw(st.sampled_from(["refuse", "fill"])))
    data = put(data, "surface.detrend", draw(KEYS["surface.detrend"]))
    kinds = ("analytic", "isolated", "consistent", "concurrent")
    data = put(data, "coupling.kind", draw(st.sampled_from(kinds)))
    data = put(data, "micro.model", draw(KEYS["micro.model"]))
    data = put(data, "block.cells", [4, 4, 4])
    data = put(data, "load.approach", draw(st.sampled_from([1e-15, 1e-6, 1e-3, 5e-3, 0.3])))
    data = put(data, "load.tilt", draw(st.sampled_from([[0.0, 0.0], [1e-3, 0.0], "free"])))
    return draw(heights()), data
