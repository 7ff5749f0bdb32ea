"""Strategies for scenes as users could write them, right, extreme and wrong, and their outcomes."""

import copy
import json
import math
import re
from functools import cache

import numpy as np
from hypothesis import strategies as st

from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.multiscale.scene.schema import scene_keys, scene_schema
from patchlaw.support import InputError, NotConverged

WHOLE = (0, -1, 1, 2, 3, 4, 5, 7, 8, 10**3, 10**6, 10**9, 10**18, 2**63, 2**64, 10**43, 10**400)
BROKEN = (
    *(0.0, -0.0, 5e-324, 1e-308, 1e-200, 1e-30, 1e-9, 1e-3, 0.5, 0.4999999, 1.5, 1e9, 1e30, 1e155),
    *(1e200, 1.7e308, float("inf"), float("-inf"), float("nan"), -1e-3, -0.999999),
)
extreme = st.sampled_from([*WHOLE, *BROKEN])
lengths = st.one_of(
    st.sampled_from(["1 mm", "5 um", 2.0, "1 nm", "1 km", 1e-300, 1e300, 5e-324, 1e155, 0, -1]),
    st.floats(-12, 12).map(lambda power: 10.0**power),
)
counts = st.one_of(st.integers(1, 40), extreme)
texts = st.sampled_from(["nowhere.npy", ".", "/dev/zero", "", "x.opd", "top", "bottom"])


def of_schema(schema):
    """Return a strategy for what a JSON Schema describes, mostly of its type.

    Args:
        schema: The schema of a value, with references into that of scenes.
    """
    return _of(schema, _parts(), depth=3)


@cache
def _parts():
    return scene_schema()["$defs"]


def _of(schema, parts, depth):
    if "$ref" in schema:
        schema = {**parts[schema["$ref"].rpartition("/")[2]], **schema}
    if "unit" in schema:
        powers = st.floats(-9, 9).map(lambda power: 10.0**power)
        examples = [st.sampled_from(schema["examples"])] * 2
        return st.one_of(*examples, powers, lengths, extreme)
    if "enum" in schema or "const" in schema:
        return st.sampled_from(schema.get("enum", [schema.get("const")]))
    if "anyOf" in schema:
        options = [one for one in schema["anyOf"] if one.get("type") != "null"]
        return st.one_of(*(_of(one, parts, depth) for one in options))
    kind = schema.get("type")
    if "properties" in schema:
        return _section(schema, parts, depth)
    if kind == "array":
        items = schema.get("prefixItems")
        if items:
            return st.tuples(*(_of(one, parts, depth) for one in items)).map(list)
        return st.lists(_of(schema["items"], parts, depth), max_size=4)
    others = {"boolean": st.booleans(), "integer": counts, "string": texts}
    low = schema.get("minimum", schema.get("exclusiveMinimum", 0.0))
    high = min(schema.get("maximum", schema.get("exclusiveMaximum", 9.0)), 1e9)
    return others.get(kind, st.one_of(st.floats(low, high), st.floats(low, high), extreme))


def _section(schema, parts, depth):
    """Return a strategy for a section: what it requires, and some of what it allows."""
    required = set(schema.get("required", ()))
    inner = {name: _of(one, parts, depth - 1) for name, one in schema["properties"].items()}
    if depth <= 0:
        return st.just({})
    return st.fixed_dictionaries(
        {name: one for name, one in inner.items() if name in required},
        optional={name: one for name, one in inner.items() if name not in required},
    )


def keys():
    """Return a strategy for each key and section of a scene that is in no list of sections."""
    known, made = scene_keys(), {}
    for name, key in known.items():
        section = name.rpartition(".")[0]
        if section and (section not in made or not _holds_keys(known[section].schema)):
            continue
        made[name] = of_schema(key.schema)
    return made


def _holds_keys(schema):
    """Tell whether a section is one, not several in a list or by names of the user's."""
    return schema.get("type") == "object" or "$ref" in schema or "anyOf" in schema


BASE = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.2, "seed": 1},
        "grid": [16, 16],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {"height": "1 mm", "young_modulus": "4 GPa", "poisson_ratio": 0.3},
    "patches": {"grid": [2, 2]},
    "micro": {"model": "half-space"},
    "coupling": {"kind": "analytic"},
    "load": {"approach": "5 um", "steps": 2},
}
FEATURES = {
    "micro.hardness": "1 GPa",
    "friction.coefficient": 0.3,
    "load.shear": [["1 um", "0 um"], ["-1 um", "0.5 um"]],
    "load.shear_steps": 2,
    "leak": {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"]},
    "conductance": {"conductivity": "50 W/m/K", "resistivity": "1e-7 ohm m"},
    "load.tilt": "free",
    "load.cycles": 2,
    "surface.periodic": True,
    "counter_body": {"young_modulus": "200 GPa", "poisson_ratio": 0.3},
}
"""Values that make sense together and ask for what `BASE` leaves out."""
UNITS = (
    "um",
    "mm",
    "m",
    "km",
    "nm",
    "GPa",
    "Pa",
    "N",
    "kg",
    "um/mm",
    "%",
    "mm^4",
    "",
    "degC",
    "dB",
)

quantity = st.builds(
    "{}{}{}".format,
    st.one_of(extreme, st.floats(), st.sampled_from(["nan", "inf", "1e99999", "1_0", "٣", "8,5"])),
    st.sampled_from([" ", "", "*", "**", "  "]),
    st.sampled_from(UNITS),
)
ODD = (
    *("", " ", "\0", "nan", "8 µm", "−8 um", "a/../b.npy", "/dev/zero", ".", "8 um 9", "9**9**9"),
    *("x" * 5000, "(" * 300, "1" + "0" * 5000 + " um", "__import__('os')", "10**10**10 um"),
)
odd_text = st.one_of(st.text(max_size=20), st.sampled_from(ODD))
scalar = st.one_of(extreme, st.integers(), st.floats(), st.booleans(), quantity, odd_text)
value = st.one_of(
    scalar,
    st.lists(scalar, max_size=4),
    st.lists(extreme, min_size=2, max_size=3),
    st.lists(st.integers(1, 40), min_size=2, max_size=3),
    st.lists(quantity, min_size=2, max_size=2),
    st.dictionaries(st.sampled_from(["seed", "hurst", "x", "grid"]), scalar, max_size=3),
    st.lists(st.lists(scalar, max_size=2), max_size=2),
)
pairs = st.tuples(counts, counts).map(list)
small = st.tuples(st.integers(1, 24), st.integers(1, 24)).map(list)
bands = st.one_of(
    st.tuples(st.integers(0, 4), st.integers(3, 9)).map(list), st.tuples(extreme, extreme).map(list)
)
slopes = st.one_of(st.floats(-0.1, 0.1), extreme)

KEYS = keys() | {
    "surface.spectrum.waves": bands,
    "surface.spectrum.waves_x": bands,
    "surface.grid": st.one_of(small, pairs),
    "block.cells": st.one_of(
        st.tuples(counts, counts, counts).map(list),
        st.lists(st.integers(1, 9), min_size=3, max_size=3),
    ),
    "patches.grid": st.one_of(small, pairs),
    "load.steps": st.one_of(st.integers(1, 9), extreme),
    "load.tilt": st.one_of(st.just("free"), st.tuples(slopes, slopes).map(list)),
}
"""Strategies for all keys; of those that a scene soon becomes too large by, smaller ones."""
strange = st.sampled_from([*KEYS, "surface", "surface.spectrum", "block", "x", "bloc.y.z", ""])


def put(data, dotted, new):
    """Return nested dictionaries with one more key; what is in its way makes place."""
    data = copy.deepcopy(data)
    *sections, name = dotted.split(".")
    inner = data
    for section in sections:
        if not isinstance(inner.get(section), dict):
            inner[section] = {}
        inner = inner[section]
    inner[name] = new
    return data


@st.composite
def scenes(draw):
    """Draw a small scene of any kind with some keys set, mostly to something of their type."""
    data = BASE
    features = draw(st.lists(st.sampled_from(sorted(FEATURES)), max_size=2, unique=True))
    for name in features:
        data = put(data, name, FEATURES[name])
        if name.startswith(("load.shear", "friction")):
            data = put(data, "friction.coefficient", 0.3)
            data = put(data, "load.shear", FEATURES["load.shear"])
    kinds = ("analytic", "concurrent", "isolated", "consistent", "reference")
    if not features or draw(st.integers(0, 3)) == 0:
        data = put(data, "coupling.kind", draw(st.sampled_from(kinds)))
        data = put(data, "micro.model", draw(st.sampled_from(["half-space", "elliptic"])))
    else:
        data = put(data, "coupling.kind", draw(st.sampled_from(kinds[:2])))
    if draw(st.booleans()):
        data = put(data, "block.cells", [4, 4, 4])
    for _ in range(draw(st.integers(0, 2))):
        name = draw(st.sampled_from(sorted(KEYS)))
        data = put(data, name, draw(KEYS[name]))
        if name == "surface.file":
            data["surface"].pop("spectrum", None)
        if name in ("load.force", "load.pressure", "load.stage"):
            data["load"].pop("approach", None)
        if name.startswith("surface.spectrum.rms_height"):
            data["surface"].get("spectrum", {}).pop("rms_slope", None)
    if draw(st.integers(0, 3)) == 0:
        data = put(data, draw(strange), draw(value))
    if draw(st.integers(0, 19)) == 0:
        del data[draw(st.sampled_from(sorted(data)))]
    return data


def toml(data):
    """Return nested dictionaries as TOML; texts as JSON writes them, which TOML can read."""
    return "".join(f"{_key(name)} = {_value(part)}\n" for name, part in data.items())


def _key(name):
    return json.dumps(name)


def _value(part):
    if isinstance(part, dict):
        return "{" + ", ".join(f"{_key(n)} = {_value(p)}" for n, p in part.items()) + "}"
    if isinstance(part, list | tuple):
        return "[" + ", ".join(map(_value, part)) + "]"
    if isinstance(part, bool):
        return str(part).lower()
    if isinstance(part, float) and not math.isfinite(part):
        return str(part)
    return json.dumps(part)


@st.composite
def damaged(draw):
    """Draw the bytes of a scene of which some are overwritten, cut or put in."""
    data = bytearray(toml(draw(scenes()) if draw(st.booleans()) else BASE).encode())
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data)))
        piece = draw(st.one_of(st.binary(max_size=6), st.sampled_from([b"[" * 2000, b"a." * 50])))
        data[at : at + draw(st.integers(0, 6))] = piece
    return bytes(data)


def takes_long(scene):
    """Whether a scene is large, but may fit into the memory of some machine."""
    sizes = [scene.surface.grid, scene.patches.grid]
    return any(isinstance(size, tuple) and 1e5 < math.prod(size) < 1e12 for size in sizes)


def planned(path, overrides=()):
    """Plan a scene as ``patchlaw plan`` does; return how that ended.

    What is wrong must be told with the file, and with the key where it is not the file as a whole.
    """
    try:
        scene = Scene.load(path, overrides)
        if takes_long(scene):
            return "not tried"
        setup = make_setup(scene)
        memory = setup.about.memory_statement(1e8, 1)
        told = [*(text for _, text in setup.about.statements(memory)), *setup.about.warnings()]
        assert re.match(r"about \d+ MB", memory), told
    except InputError as error:
        told = str(error)
        of_heights = str(error.key).endswith("surface.file")  # which names the file of heights
        assert str(path) in told or of_heights or (overrides and error.key is None), told
        assert error.key or re.search(
            "is not (valid TOML|UTF-8)|cannot be read|no such file|override|nested too deeply", told
        )
        assert len(told) < 2000, told[:300]
        return "refused"
    except NotConverged:
        return "not converged"
    return "planned"


def ran(path):
    """Run a small scene without files; return how that ended, "not tried" if it is not small."""
    try:
        scene = Scene.load(path)
        if takes_long(scene):
            return "not tried"
        setup = make_setup(scene)
        meshes = getattr(setup, "rough_meshes", None)
        meshes = [] if meshes is None else meshes.unknowns
        large = (
            setup.parts.surface.heights.size > 600
            or setup.parts.patches.count > 16
            or scene.loading.steps > 9
            or sum(meshes) > 5000
            or math.prod(setup.parts.body.shape.cells) > 800
        )
        if large or (scene.block.margin and scene.block.margin_cells > 4):
            return "not tried"
        history = run(scene)
    except InputError as error:
        assert str(path) in str(error) or error.key.endswith("surface.file")
        return "refused"
    except NotConverged:
        return "not converged"
    for name in ("force_N", "contact_area_fraction", "mean_separation_mm"):
        assert np.isfinite(getattr(history, name)).all(), name
    return "ran"
