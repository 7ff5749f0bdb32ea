"""The cache on disk: hits, misses, damaged files and the switch."""

import numpy as np
import pytest
from mpi4py import MPI

from macro.compliance_cache import cache_directory, cached


@pytest.fixture
def counted(monkeypatch, tmp_path):
    monkeypatch.setenv("PATCHLAW_CACHE", str(tmp_path / "deep" / "cache"))
    calls = []

    def compute():
        calls.append(1)
        return {"c": np.arange(6.0).reshape(2, 3) / 7.0}

    return calls, compute


def test_same_key_is_computed_once_and_read_back_to_the_last_bit(counted):
    calls, compute = counted
    first = cached("kind", (1, 2.5), compute, MPI.COMM_SELF)
    second = cached("kind", (1, 2.5), compute, MPI.COMM_SELF)
    assert len(calls) == 1
    np.testing.assert_array_equal(first["c"], second["c"])


def test_other_key_or_kind_is_computed_anew(counted):
    calls, compute = counted
    for kind, key in (("kind", (1.0,)), ("kind", (np.nextafter(1.0, 2.0),)), ("other", (1.0,))):
        cached(kind, key, compute, MPI.COMM_SELF)
    assert len(calls) == 3


@pytest.mark.parametrize("content", [b"", b"nonsense", "half"])
def test_damaged_file_is_replaced(counted, content):
    calls, compute = counted
    cached("kind", (), compute, MPI.COMM_SELF)
    (path,) = cache_directory().iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if content == "half" else content)
    again = cached("kind", (), compute, MPI.COMM_SELF)
    assert len(calls) == 2
    np.testing.assert_array_equal(again["c"], compute()["c"])
    assert [file.name for file in cache_directory().iterdir()] == [path.name]
    assert path.read_bytes() != content


def test_off_keeps_nothing(counted, monkeypatch):
    calls, compute = counted
    monkeypatch.setenv("PATCHLAW_CACHE", "off")
    for _ in range(2):
        cached("kind", (), compute, MPI.COMM_SELF)
    assert len(calls) == 2 and cache_directory() is None


def test_directory_that_cannot_be_made_does_not_stop_the_run(counted, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PATCHLAW_CACHE", str(tmp_path / "file" / "below"))
    assert "c" in cached("kind", (), counted[1], MPI.COMM_SELF)
