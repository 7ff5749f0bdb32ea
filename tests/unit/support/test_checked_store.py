"""The checked store: every bit comes back, and no damaged byte is believed."""

from itertools import pairwise

import numpy as np
import pytest

from support.checked_store import (
    START,
    Record,
    append,
    end_of,
    read_record,
    sealed,
    unsealed,
    write_record,
)
from support.errors import InputError


def records(count=4):
    """Return records with arrays of all kinds and shapes."""
    dice = np.random.default_rng(3)
    return [
        Record(
            {"number": k, "text": "µ\n", "nan": float("nan"), "nested": [[1.5, None], {"a": True}]},
            {"a": dice.normal(size=(k, 2)), "b": np.arange(k), "c": np.array(1 + 2j),
             "texts": np.array(["a", "bcd"]), "of Fortran": np.asfortranarray(np.eye(3) * k)},
        )
        for k in range(count)
    ]  # fmt: skip


def same(found, wanted):
    assert repr(found.facts) == repr(wanted.facts)  # NaN is not equal to itself
    assert list(found.arrays) == list(wanted.arrays)
    for name, array in wanted.arrays.items():
        np.testing.assert_array_equal(found.arrays[name], array)
        assert found.arrays[name].dtype == array.dtype
        assert found.arrays[name].flags.writeable


def test_records_come_back_to_the_last_bit(tmp_path):
    content, mark = sealed(records())
    assert (mark.records, mark.size) == (4, len(content))
    for (found, _), wanted in zip(unsealed(content), records(), strict=True):
        same(found, wanted)
    assert mark == end_of(content)
    path = write_record(tmp_path / "one", *records()[3])
    same(read_record(path.read_bytes()), records()[3])


def test_a_file_grows_and_forgets_what_a_killed_process_left(tmp_path):
    path, mark = tmp_path / "log", START
    for record in records():
        mark = append(path, [record], mark)
        with path.open("ab") as file:
            file.write(sealed([record], mark)[0][:-1])  # the next one, not quite written
        assert end_of(path.read_bytes()) == mark
    mark = append(path, [], mark)
    assert path.read_bytes() == sealed(records())[0]


def test_objects_are_not_stored():
    with pytest.raises(TypeError, match="array a of object cannot be stored"):
        sealed([Record(None, {"a": np.array([None])})])


def damaged(content, dice, bounds):
    """Return content that differs: bits turned, cut off, added, records exchanged or repeated."""
    kind, at = dice.integers(5), int(dice.integers(len(content)))
    if kind == 0:
        changed = bytearray(content)
        changed[at] ^= 1 << int(dice.integers(8))
        return bytes(changed)
    if kind == 1:
        return content[:at]
    if kind == 2:
        return content[:at] + dice.bytes(int(dice.integers(1, 100))) + content[at:]
    if kind == 3:
        return content[:at] + content[at + int(dice.integers(1, 100)) :]
    order = dice.integers(len(bounds), size=len(bounds))
    return b"".join(content[bounds[k][0] : bounds[k][1]] for k in order)


def test_no_damage_is_believed():
    """What is read of a damaged file is the beginning of what was written, or nothing."""
    content, _ = sealed(records())
    ends = [0, *(mark.size for _, mark in unsealed(content))]
    bounds, dice, ways = list(pairwise(ends)), np.random.default_rng(1), set()
    for _ in range(600):
        changed, found, way = damaged(content, dice, bounds), [], "to its end"
        try:
            found.extend(record for record, _ in unsealed(changed))
        except InputError as error:
            assert "is damaged" in str(error)
            way = "refused"
        for one, wanted in zip(found, records(), strict=False):
            same(one, wanted)
        assert len(found) <= 4
        ways.add((way, len(found)))
        with pytest.raises(InputError, match="is damaged"):
            read_record(changed)  # which holds more or less than one record
    assert {way for way, _ in ways} == {"refused", "to its end"}
