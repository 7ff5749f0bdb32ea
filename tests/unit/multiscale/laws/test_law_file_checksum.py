"""Files of HDF5 are known to be whole before the library that reads them sees a byte."""

import subprocess
import sys

import h5py
import numpy as np
import pytest

from patchlaw.support import InputError
from patchlaw.support.files import check_hdf5, checksum_hdf5, hdf5_bytes


@pytest.fixture
def path(tmp_path):
    content = hdf5_bytes(h5py.File, lambda file: file.create_dataset("x", data=np.arange(5.0)))
    (tmp_path / "a.h5").write_bytes(content)
    return tmp_path / "a.h5"


def test_every_reader_of_hdf5_opens_it(path):
    check_hdf5(path.read_bytes())
    with h5py.File(path) as file:
        assert file["x"][()].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert path.read_bytes().startswith(b"patchlaw, SHA-256 of all bytes from 512 on: ")


def test_any_changed_byte_is_found(path):
    whole = path.read_bytes()
    for at in range(0, len(whole), 37):  # the checksum and the room behind it included
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        with pytest.raises(InputError, match=r"its checksum does not fit its content|has no check"):
            check_hdf5(bytes(damaged))
    for damaged in (whole[:-1], whole + b"\0", whole[:300]):
        with pytest.raises(InputError, match="is damaged: its checksum does not fit its content"):
            check_hdf5(damaged)
    with pytest.raises(InputError, match="has no checksum before its content: it is none of ours"):
        check_hdf5(b"")


def test_a_seal_fits_but_once(path):
    whole = path.read_bytes()
    assert checksum_hdf5(whole) == whole


def test_damage_costs_no_memory(tmp_path):
    """A length field of an attribute, damaged, had HDF5 allocate gigabytes."""
    code = (
        "import h5py, resource, sys; from pathlib import Path\n"
        "from patchlaw.support.errors import InputError\n"
        "from patchlaw.multiscale.laws.law_table import read_laws\n"
        "from patchlaw.support.files import hdf5_bytes\n"
        "def fill(file): file.attrs['format'] = 'patchlaw laws 2'\n"
        "path = Path(sys.argv[1])\n"
        "path.write_bytes(hdf5_bytes(h5py.File, fill))\n"
        "whole, before = path.read_bytes(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "for at in range(512, len(whole), 13):\n"
        "    path.write_bytes(whole[:at] + b'\\xff\\xff\\xff\\xff' + whole[at + 4:])\n"
        "    try: read_laws(path)\n"
        "    except InputError: pass\n"
        "after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "sys.exit(after - before > 20_000)"  # kB
    )
    words = [sys.executable, "-c", code, str(tmp_path / "laws.h5")]
    assert subprocess.run(words, check=False, timeout=60).returncode == 0
