"""The checked store: every bit comes back, and no damaged byte is believed."""

from dataclasses import dataclass, fields, is_dataclass
from typing import NamedTuple

import numpy as np
import pytest

from patchlaw.support import InputError, NotWritten
from patchlaw.support.files import append, fingerprint, read_record, sealed, unsealed, write_record


class Pair(NamedTuple):
    """A named tuple."""

    first: object
    second: object = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whole:
    """A record of all that is stored."""

    number: int
    nan: float
    nested: tuple
    of_json: dict
    bits: bytes
    pair: Pair
    a: np.ndarray
    of_fortran: np.ndarray


KINDS = (Whole, Pair)


def records(count=4):
    """Return records with arrays of all kinds and shapes."""
    dice = np.random.default_rng(3)
    return [
        Whole(
            number=k, nan=float("nan"), nested=((1.5, None), (True, "µ\n")),
            of_json={"list": [1, [2]], "b": np.arange(k)}, bits=bytes(range(k)),
            pair=Pair(np.array(1 + 2j), np.array(["a", "bcd"])),
            a=dice.normal(size=(k, 2)), of_fortran=np.asfortranarray(np.eye(3) * k),
        )
        for k in range(count)
    ]  # fmt: skip


def same(found, wanted):
    """Compare two values to the last bit, types included."""
    assert type(found) is type(wanted)
    if isinstance(wanted, np.ndarray):
        np.testing.assert_array_equal(found, wanted)
        assert found.dtype == wanted.dtype and found.flags.writeable
    elif is_dataclass(wanted):
        for field in fields(wanted):
            same(getattr(found, field.name), getattr(wanted, field.name))
    elif isinstance(wanted, dict):
        assert list(found) == list(wanted)
        for name in wanted:
            same(found[name], wanted[name])
    elif isinstance(wanted, tuple | list):
        for one, other in zip(found, wanted, strict=True):
            same(one, other)
    else:
        assert repr(found) == repr(wanted)  # NaN is not equal to itself


def test_records_come_back_to_the_last_bit(tmp_path):
    content = b"".join(map(sealed, records()))
    for (found, _), wanted in zip(unsealed(content, KINDS), records(), strict=True):
        same(found, wanted)
    path = write_record(tmp_path / "one", records()[3])
    same(read_record(path.read_bytes(), KINDS), records()[3])


def test_a_file_grows_and_forgets_what_a_killed_process_left(tmp_path):
    path, end, values = tmp_path / "log", 0, [{"a": np.arange(k)} for k in range(4)]
    for value in values:
        end = append(path, value, end)
        assert path.stat().st_size == end
        with path.open("ab") as file:
            file.write(sealed(value)[:-1])  # the next one, not quite written
        assert list(unsealed(path.read_bytes()))[-1][1] == end
    append(path, None, end)
    assert path.read_bytes() == b"".join(map(sealed, [*values, None]))


def test_failed_write_leaves_what_was_written(tmp_path, monkeypatch):
    path = tmp_path / "log"
    first = append(path, 1, 0)

    def full(number):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("patchlaw.support.files.os.fsync", full)
    with pytest.raises(NotWritten, match="log: cannot be written: No space left on device"):
        append(path, 2, first)
    assert next(unsealed(path.read_bytes())) == (1, first)


def test_objects_are_not_stored():
    with pytest.raises(TypeError, match="an array of object cannot be stored"):
        sealed({"a": np.array([None])})
    with pytest.raises(TypeError, match="Object of type set is not JSON serializable"):
        sealed({"a": {1, 2}})


def test_no_other_class_is_called():
    content = sealed(records(1)[0])
    for kinds in ((), (Pair,), (Whole,)):
        with pytest.raises(InputError, match=r"^was written by another patchlaw$"):
            read_record(content, kinds)


def test_records_whose_fields_differ_are_of_another_version(monkeypatch):
    content = sealed(Pair(1.0))

    class Renamed(NamedTuple):
        first: float
        third: float = 0.0

    Renamed.__name__ = "Pair"
    with pytest.raises(InputError, match="was written by another patchlaw"):
        read_record(content, (Renamed,))


def test_a_fingerprint_is_of_every_bit_and_name():
    values = [{"a": 0.1}, {"b": 0.1}, {"a": np.nextafter(0.1, 1.0)}, {"a": np.array(0.1)},
              Pair(0.1), Pair(0.1, 1)]  # fmt: skip
    assert len({fingerprint(value) for value in values}) == len(values)
    assert fingerprint({"a": np.float64(0.1), "b": np.int64(2)}) == fingerprint({"a": 0.1, "b": 2})


def damaged(content, dice):
    """Return content that differs: bits turned, cut off, added or left out."""
    kind, at = dice.integers(4), int(dice.integers(len(content)))
    if kind == 0:
        changed = bytearray(content)
        changed[at] ^= 1 << int(dice.integers(8))
        return bytes(changed)
    if kind == 1:
        return content[:at]
    if kind == 2:
        return content[:at] + dice.bytes(int(dice.integers(1, 100))) + content[at:]
    return content[:at] + content[at + int(dice.integers(1, 100)) :]


def test_no_damage_is_believed():
    """What is read of a damaged file is the beginning of what was written, or nothing."""
    content = b"".join(map(sealed, records()))
    dice, ways = np.random.default_rng(1), set()
    for _ in range(600):
        changed, found, way = damaged(content, dice), [], "to its end"
        try:
            found.extend(record for record, _ in unsealed(changed, KINDS))
        except InputError as error:
            assert "is damaged" in str(error)
            way = "refused"
        for one, wanted in zip(found, records(), strict=False):
            same(one, wanted)
        assert len(found) <= 4
        ways.add(way)
        with pytest.raises(InputError, match="is damaged"):
            read_record(changed, KINDS)  # which holds more or less than one record
    assert ways == {"refused", "to its end"}
