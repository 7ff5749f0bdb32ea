"""The cache on disk: hits, misses, damaged files and the switch."""

import os

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import PatchGrid
from patchlaw.macro import disk_caches as compliance_cache
from patchlaw.macro.disk_caches import cache_directory, cached
from patchlaw.support.files import read_record, write_record


def is_cached(kind, key):
    """Tell whether arrays come from the cache instead of being made."""
    made = []
    cached(kind, key, lambda: made.append(kind) or {"c": np.zeros(1)}, MPI.COMM_SELF)
    return not made


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


def test_key_does_not_depend_on_how_numpy_prints(counted):
    calls, compute = counted
    for value in (0.1, np.float64(0.1)):
        for count in (2, np.int64(2)):
            cached(
                "kind",
                (PatchGrid(grid=(1, 1), lengths=(value, 1.0)), count),
                compute,
                MPI.COMM_SELF,
            )
    assert len(calls) == 1
    cached("kind", (PatchGrid(grid=(1, 1), lengths=(0.2, 1.0)), 2), compute, MPI.COMM_SELF)
    assert len(calls) == 2


def test_key_of_unknown_kind_is_refused_before_any_rank_waits(counted):
    class Second:
        """A rank that would wait for the first in whatever it does together."""

        rank, size = 1, 2

    with pytest.raises(TypeError, match="set is not JSON serializable"):
        cached("kind", ({3},), counted[1], Second())


def test_what_was_not_used_for_longest_goes_first(counted, monkeypatch):
    calls, compute = counted
    for key in range(3):
        cached("kind", (key,), compute, MPI.COMM_SELF)
    for age, path in enumerate(
        sorted(cache_directory().iterdir(), key=lambda p: p.stat().st_mtime)
    ):
        os.utime(path, (1e6 + age, 1e6 + age))
    cached("kind", (0,), compute, MPI.COMM_SELF)  # a hit makes it the youngest
    size = path.stat().st_size
    monkeypatch.setattr(compliance_cache, "MOST_BYTES", 2.5 * size)
    cached("kind", (3,), compute, MPI.COMM_SELF)
    assert len(list(cache_directory().iterdir())) == 2
    before = len(calls)
    for key in (0, 3):
        cached("kind", (key,), compute, MPI.COMM_SELF)
    assert len(calls) == before


def test_files_of_others_in_the_folder_are_never_removed(counted, monkeypatch):
    """A folder of data may be named by mistake: what looks like ours by name alone stays."""
    _, compute = counted
    folder = cache_directory()
    folder.mkdir(parents=True)
    cached("kind", (0,), compute, MPI.COMM_SELF)
    (own,) = folder.iterdir()
    other_key = f"kind-{'0' * 32}.arrays"  # the content of another name
    foreign = {
        "scan-2026.txt": b"1 2 3\n", "a-b.arrays": own.read_bytes(), other_key: own.read_bytes(),
        f"kind-{'1' * 32}.arrays": b"heights of my own", ".x-y.partial-1": b"",
    }  # fmt: skip
    for name, content in foreign.items():
        (folder / name).write_bytes(content)
    (folder / "measured-maps.v2").mkdir()
    (folder / f"link-{own.name.split('-')[1]}").symlink_to(folder / "scan-2026.txt")
    for path in folder.iterdir():
        os.utime(path, (1e6, 1e6), follow_symlinks=False)
    monkeypatch.setattr(compliance_cache, "MOST_BYTES", 1.5 * own.stat().st_size)
    cached("kind", (1,), compute, MPI.COMM_SELF)
    assert not own.exists()  # ours, the oldest and one too many
    assert {name: (folder / name).read_bytes() for name in foreign} == foreign
    assert len(list(folder.iterdir())) == len(foreign) + 3


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


def test_nobody_at_home_keeps_nothing(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(compliance_cache.Path, "home", homeless)
    for variable in ("PATCHLAW_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)
    assert cache_directory() is None


def test_sound_file_of_another_key_is_not_believed(counted):
    """A file that is renamed, as by a copy into the wrong place, fits its checksum."""
    calls, compute = counted
    cached("kind", (1,), compute, MPI.COMM_SELF)
    (one,) = cache_directory().iterdir()
    cached("kind", (2,), lambda: {"c": np.full(3, 9.0)}, MPI.COMM_SELF)
    (other,) = set(cache_directory().iterdir()) - {one}
    other.replace(one)
    before = len(calls)
    np.testing.assert_array_equal(cached("kind", (1,), compute, MPI.COMM_SELF)["c"], compute()["c"])
    assert len(calls) == before + 2


@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_file_that_others_can_write_is_not_believed(counted, mode):
    _, compute = counted
    cached("kind", (), compute, MPI.COMM_SELF)
    (path,) = cache_directory().iterdir()
    assert path.stat().st_mode & 0o777 == 0o600
    assert cache_directory().stat().st_mode & 0o022 == 0
    write_record(path, read_record(path.read_bytes()) | {"arrays": {"c": np.ones(9)}})
    path.chmod(0o600)
    assert cached("kind", (), compute, MPI.COMM_SELF)["c"].shape == (9,)  # the user's own
    path.chmod(mode)
    np.testing.assert_array_equal(cached("kind", (), compute, MPI.COMM_SELF)["c"], compute()["c"])
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(("owner", "believed"), [(0, True), (12345, False)])
def test_only_own_files_and_those_of_root_are_believed(counted, monkeypatch, owner, believed):
    _, compute = counted
    cached("kind", (), compute, MPI.COMM_SELF)
    fstat = os.fstat

    def owned(number):
        facts = list(fstat(number))
        facts[4] = owner
        return os.stat_result(facts)

    monkeypatch.setattr(compliance_cache.os, "fstat", owned)
    monkeypatch.setattr(compliance_cache.os, "geteuid", lambda: 777)
    assert is_cached("kind", ()) == believed


def test_pipes_and_folders_in_the_cache_are_passed_over(counted):
    _, compute = counted
    cached("kind", (), compute, MPI.COMM_SELF)
    (path,) = cache_directory().iterdir()
    path.unlink()
    os.mkfifo(path)
    assert not is_cached("kind", ())  # nor waited for
    path.unlink()
    path.mkdir()
    np.testing.assert_array_equal(cached("kind", (), compute, MPI.COMM_SELF)["c"], compute()["c"])


def test_other_sources_find_nothing(counted, monkeypatch):
    calls, compute = counted
    cached("kind", (1,), compute, MPI.COMM_SELF)
    monkeypatch.setattr(compliance_cache, "sources_digest", lambda *_: "of another day")
    cached("kind", (1,), compute, MPI.COMM_SELF)
    assert len(calls) == 2


def test_every_source_counts(tmp_path):
    for name in (
        "macro/compliance/quarter.py",
        "geometry/patches.py",
        "micro/closed_forms/love.py",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("one = 1\n")
    digest = compliance_cache.sources_digest.__wrapped__  # without its memory
    digests = [digest(tmp_path)]
    for name, text in (
        ("macro/compliance/line.py", "one = 2\n"),
        ("geometry/patches.py", "one = 3\n"),
        ("micro/closed_forms/love.py", "one = 4\n"),
    ):
        (tmp_path / name).write_text(text)
        digests.append(digest(tmp_path))
    assert len(set(digests)) == 4
    (tmp_path / "multiscale").mkdir()
    (tmp_path / "multiscale/run.py").write_text("one = 5\n")
    assert digest(tmp_path) == digests[3]  # no array depends on it
