"""Files of HDF5 are known to be whole before the library that reads them sees a byte."""

import subprocess
import sys

import h5py
import numpy as np
import pytest

from multiscale.storage import checksum, checksummed, verified
from support.errors import InputError


@pytest.fixture
def path(tmp_path):
    content = checksummed(lambda file: file.create_dataset("x", data=np.arange(5.0)))
    (tmp_path / "a.h5").write_bytes(content)
    return tmp_path / "a.h5"


def test_every_reader_of_hdf5_opens_it(path):
    with h5py.File(path) as file, h5py.File(verified(path)) as other:
        assert file["x"][()].tolist() == other["x"][()].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert path.read_bytes().startswith(b"patchlaw, SHA-256 of all bytes from 512 on: ")


def test_any_changed_byte_is_found(path):
    whole = path.read_bytes()
    for at in range(0, len(whole), 37):  # the checksum and the room behind it included
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"its checksum does not fit its content|has no check"):
            verified(path)
    for damaged in (whole[:-1], whole + b"\0", whole[:300]):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="is damaged: its checksum does not fit its content"):
            verified(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="has no checksum before its content: it is none of ours"):
        verified(path)


def test_a_seal_fits_but_once(path):
    whole = path.read_bytes()
    assert checksum(whole) == whole
    assert verified(path.open("rb")).getvalue() == whole


def test_damage_costs_no_memory(tmp_path):
    """A length field of an attribute, damaged, had HDF5 allocate gigabytes."""
    code = (
        "import resource, sys; from pathlib import Path\n"
        "from support.errors import InputError\n"
        "from multiscale.laws.law_file import read_laws\n"
        "from multiscale.storage import checksummed\n"
        "from multiscale.laws.law_file import read_laws\n"
        "from multiscale.storage import checksummed\n"
        "def fill(file): file.attrs['format'] = 'patchlaw laws 2'\n"
        "path = Path(sys.argv[1])\n"
        "path.write_bytes(checksummed(fill))\n"
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
