"""Law files and checkpoints of any content are read, or refused in one line that names them."""

import os

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.scene_inputs import BASE
from benchmarks.stored_inputs import READERS, flipped, originals, read, rewritten
from patchlaw.multiscale import read_laws
from patchlaw.multiscale.results.files import csv_rows, result_of_a_run
from patchlaw.multiscale.runs.cases import Journal
from patchlaw.multiscale.runs.output.results_folder import is_finished, read_checkpoint
from patchlaw.support import InputError, NotWritten
from patchlaw.support.files import checksum_hdf5, remove

few = settings(
    derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return originals(BASE, tmp_path_factory.mktemp("whole"))


@settings(few, max_examples=40)
@given(st.data())
def test_damaged_files(tmp_path_factory, whole, data):
    which = data.draw(st.integers(0, 1))
    damage = data.draw(st.sampled_from([flipped, rewritten][: 2 - which]))  # laws alone are HDF5
    path = tmp_path_factory.getbasetemp() / "stored.h5"
    path.write_bytes(data.draw(damage(whole[which])))
    read(path, READERS[which])


@pytest.mark.parametrize("which", [0, 1])
def test_whole_files_are_read(tmp_path, whole, which):
    (tmp_path / "a.h5").write_bytes(whole[which])
    assert read(tmp_path / "a.h5", READERS[which]) == "read"


def changed_laws(tmp_path, whole, change):
    """Return why a law file is refused after a change."""
    path = tmp_path / "laws.h5"
    path.write_bytes(whole[0])
    with h5py.File(path, "r+") as file:
        change(file)
    path.write_bytes(checksum_hdf5(path.read_bytes()))
    with pytest.raises(InputError) as refusal:
        read_laws(path)
    return str(refusal.value).removeprefix(f"{path}: ")


def test_columns_are_numbers_that_the_file_holds(tmp_path, whole):
    def promise(file):
        del file["patch_0_0/pressure"]
        file.create_dataset("patch_0_0/pressure", (10**6, 10**6), "f8", chunks=(100, 100))

    def words(file):
        del file["patch_0_0/pressure"]
        file["patch_0_0/pressure"] = np.array([b"a", b"b"])

    def no_group(file):
        del file["patch_0_0"]
        file.create_dataset("patch_0_0", (10**6, 10**6), "f8", chunks=(100, 100))

    def grid(file):
        file.attrs["patch_grid"] = (10**9, 10**9)

    assert "/patch_0_0/pressure is not whole" in changed_laws(tmp_path, whole, promise)
    assert "/patch_0_0/pressure is not a column of numbers" in changed_laws(tmp_path, whole, words)
    assert changed_laws(tmp_path, whole, no_group) == "/patch_0_0 is no group of columns"
    lacking = changed_laws(tmp_path, whole, grid)
    assert lacking == "(1000000000, 1000000000): lacks laws (allowed: 4 groups)"


def test_pipes_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe: is no regular file"):
        read_laws(tmp_path / "pipe")
    with pytest.raises(InputError, match="cannot be read: is no file; remove it, or begin"):
        read_checkpoint(tmp_path / "pipe")
    with pytest.raises(InputError, match=r"pipe: is not the result of a run: .*is no file"):
        result_of_a_run(tmp_path / "pipe").__enter__()
    with pytest.raises(InputError, match="pipe: cannot be read: is no file"):
        csv_rows(tmp_path / "pipe")
    os.mkfifo(tmp_path / "provenance.json")
    assert not is_finished(tmp_path, {})


def test_journal_that_is_no_file_is_named(tmp_path):
    journal = Journal(tmp_path, {})
    path = tmp_path / "journal"
    for make in (os.mkfifo, os.mkdir):
        make(path)
        with pytest.raises(InputError, match="journal: cannot be read: is no file; remove it"):
            list(journal.read(path))
        path.unlink() if path.is_fifo() else path.rmdir()


def test_folder_in_the_place_of_a_file_to_remove_is_named(tmp_path):
    (tmp_path / "contact.h5").mkdir()
    with pytest.raises(NotWritten, match=r"contact\.h5: cannot be written: Is a directory"):
        remove(tmp_path / "contact.h5")
