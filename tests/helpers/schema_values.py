"""Strategies for the values of scene keys, made from the JSON Schema that checks scenes.

A key that is added to a scene is tried with right, extreme and wrong values without more ado.
"""

from functools import cache

from hypothesis import strategies as st

from patchlaw.multiscale.scene.schema import scene_keys, scene_schema

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
