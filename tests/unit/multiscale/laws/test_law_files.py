"""Laws survive a file bit for bit, and anything else is refused."""

from dataclasses import fields, replace

import h5py
import numpy as np
import pytest

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale import LawTable, PatchLaw, read_laws, write_laws
from patchlaw.multiscale.laws.rows import LawRows, PlanePath, Transmissivity, Untouched
from patchlaw.support import InputError
from patchlaw.support.files import checksum_hdf5, hdf5_bytes

SCALARS = (
    "first_touch", "initial_separation", "interpolation_error", "stiffness_error",
    "warning_pressure", "repaired",
)  # fmt: skip
COLUMNS = ("closure", "pressure", "approach", "contact_area_fraction", "contacts", "relief")


@pytest.fixture
def table():
    random = np.random.default_rng(5)

    def law(rows):
        rising = np.sort(random.random((5, rows)), axis=1)
        rising[1, :1] = 0.0
        columns = LawRows(
            closure=rising[0], pressure=rising[1], approach=rising[2],
            contact_area_fraction=rising[3], contacts=np.arange(rows),
            unresolved_displacement=rising[4],
        )  # fmt: skip
        return PatchLaw(
            rows=columns, first_touch=rising[0, 0] if rows else np.inf,
            initial_separation=random.random(), interpolation_error=1 / 3, stiffness_error=1 / 7,
            warning_pressure=1 / 11,
            transmissivity=Transmissivity(
                separation=rising[4] + np.arange(rows), hydraulic_gap=random.random((rows, 2)),
                on_half=random.random((rows, 2)), scatter=random.random((rows, 2)),
            ) if rows > 2 else None,
            untouched=Untouched(
                closure=-np.sort(random.random(rows // 2))[::-1],
                unresolved_displacement=random.random(rows // 2),
            ),
        )  # fmt: skip

    patches = PatchGrid(grid=(2, 3), lengths=(0.1, 1 / 3))
    laws = tuple(law(rows) for rows in (7, 0, 2, 3, 4, 5))
    made_by = {"model": "elliptic", "love": "mean"}
    path = PlanePath(
        approach=np.array([0.1, 1 / 3]),
        tilt=random.random((2, 2)),
        force=np.array([0.0, 1 / 7]),
        moment=random.random((2, 2)),
    )
    return LawTable(patches=patches, laws=laws, made_by=made_by, force_error=1 / 9, path=path)


def test_round_trip_is_exact(table, tmp_path):
    write_laws(tmp_path / "laws.h5", table)
    back = read_laws(tmp_path / "laws.h5")
    assert back.patches == table.patches
    assert (back.made_by, back.force_error) == (table.made_by, table.force_error)
    for law, copy in zip(table.laws, back.laws, strict=True):
        for (name, column), (_, again) in zip(law.rows.columns(), copy.rows.columns(), strict=True):
            assert column.tobytes() == again.tobytes(), name
        for name in SCALARS:
            assert getattr(law, name) == getattr(copy, name)
        for one in fields(law.untouched):
            values = (getattr(each.untouched, one.name) for each in (law, copy))
            np.testing.assert_array_equal(*values)
        assert (law.transmissivity is None) == (copy.transmissivity is None)
        for one in fields(law.transmissivity) if law.transmissivity else ():
            values = (getattr(each.transmissivity, one.name) for each in (law, copy))
            np.testing.assert_array_equal(*values)
    for name in ("approach", "tilt", "force", "moment"):
        assert getattr(table.path, name).tobytes() == getattr(back.path, name).tobytes()
    write_laws(tmp_path / "laws.h5", replace(table, path=None))
    assert read_laws(tmp_path / "laws.h5").path is None


def test_every_column_says_its_unit(table, tmp_path):
    write_laws(tmp_path / "laws.h5", table)
    with h5py.File(tmp_path / "laws.h5") as file:
        units = {name: file["patch_0_0"][name].attrs["unit"] for name in COLUMNS}
        flow = {name: one.attrs["unit"] for name, one in file["patch_0_0/transmissivity"].items()}
    assert units["closure"] == "mm"
    assert units["pressure"] == "MPa"
    assert (flow["hydraulic_gap_x"], flow["scatter_y"]) == ("mm", "mm^3")


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "laws.h5"
    with pytest.raises(InputError, match=r"laws\.h5: there is no such file"):
        read_laws(path)
    path.write_bytes(checksum_hdf5(b"no HDF5"))
    with pytest.raises(InputError, match=r"laws.h5: is not a readable law file: "):
        read_laws(path)
    path.write_bytes(hdf5_bytes(h5py.File, lambda file: file.create_dataset("x", data=1)))
    with pytest.raises(InputError, match=r"laws.h5: is not a law file of patchlaw"):
        read_laws(path)


@pytest.mark.parametrize(("what", "problem"), [
    (lambda file: file.attrs.modify("format", "patchlaw laws 2"), "is not a law file of patchlaw"),
    (lambda file: file.pop("patch_1_2/pressure"), "is not a readable law file: .*pressure"),
    (lambda file: file["patch_0_0/closure"].write_direct(np.full(7, np.nan)),
     "needs a finite closure"),
], ids=["earlier format", "missing column", "damaged law"])  # fmt: skip
def test_changed_files_are_refused(table, tmp_path, what, problem):
    """Closures of an earlier format were taken with another compliance."""
    path = tmp_path / "laws.h5"
    write_laws(path, table)
    with h5py.File(path, "r+") as file:
        what(file)
    path.write_bytes(checksum_hdf5(path.read_bytes()))
    with pytest.raises(InputError, match=rf"laws.h5: .*{problem}"):
        read_laws(path)


def test_one_law_per_patch(table):
    with pytest.raises(InputError, match="5: needs one law per patch"):
        LawTable(patches=table.patches, laws=table.laws[1:], made_by={})
