"""Laws survive a file bit for bit, and anything else is refused."""

import h5py
import numpy as np
import pytest

from geometry.errors import InputError
from geometry.patches import PatchGrid
from multiscale.law_files import LawTable, read_laws, write_laws
from multiscale.laws import PatchLaw

COLUMNS = ("closure", "pressure", "approach", "contact_area_fraction", "contacts", "relief")


@pytest.fixture
def table():
    random = np.random.default_rng(5)

    def law(rows):
        rising = np.sort(random.random((5, rows)), axis=1)
        rising[1, :1] = 0.0
        return PatchLaw(
            closure=rising[0],
            pressure=rising[1],
            approach=rising[2],
            contact_area_fraction=rising[3],
            contacts=np.arange(rows),
            relief=rising[4],
            touch=rising[0, 0] if rows else np.inf,
            reach=random.random(),
            interpolation_error=1 / 3,
        )

    patches = PatchGrid(grid=(2, 3), lengths=(0.1, 1 / 3))
    laws = tuple(law(rows) for rows in (7, 0, 2, 3, 4, 5))
    return LawTable(patches=patches, laws=laws, made_by={"model": "elliptic", "love": "mean"})


def test_round_trip_is_exact(table, tmp_path):
    write_laws(tmp_path / "laws.h5", table)
    back = read_laws(tmp_path / "laws.h5")
    assert back.patches == table.patches
    assert back.made_by == table.made_by
    for law, copy in zip(table.laws, back.laws, strict=True):
        for name in COLUMNS:
            assert getattr(law, name).tobytes() == getattr(copy, name).tobytes()
        assert (law.touch, law.reach, law.interpolation_error) == (
            copy.touch,
            copy.reach,
            copy.interpolation_error,
        )


def test_every_column_says_its_unit(table, tmp_path):
    write_laws(tmp_path / "laws.h5", table)
    with h5py.File(tmp_path / "laws.h5") as file:
        units = {name: file["patch_0_0"][name].attrs["unit"] for name in COLUMNS}
    assert units["closure"] == "mm"
    assert units["pressure"] == "MPa"


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "laws.h5"
    with pytest.raises(InputError, match="is not a readable law file"):
        read_laws(path)
    path.write_text("no HDF5", encoding="utf-8")
    with pytest.raises(InputError, match="is not a readable law file"):
        read_laws(path)
    with h5py.File(path, "w") as file:
        file["x"] = 1
    with pytest.raises(InputError, match=r"laws.h5: is not a law file of patchlaw"):
        read_laws(path)


def test_missing_column_is_refused(table, tmp_path):
    path = tmp_path / "laws.h5"
    write_laws(path, table)
    with h5py.File(path, "a") as file:
        del file["patch_1_2/pressure"]
    with pytest.raises(InputError, match=r"is not a readable law file: .*pressure"):
        read_laws(path)


def test_damaged_law_is_refused(table, tmp_path):
    path = tmp_path / "laws.h5"
    write_laws(path, table)
    with h5py.File(path, "a") as file:
        file["patch_0_0/closure"][3] = np.nan
    with pytest.raises(InputError, match=r"laws.h5: .*closure that increases from"):
        read_laws(path)


def test_one_law_per_patch(table):
    with pytest.raises(InputError, match="5: needs one law per patch"):
        LawTable(patches=table.patches, laws=table.laws[1:], made_by={})
