"""A patch law against closed forms that its table was made from."""

import numpy as np
import pytest

from patchlaw.multiscale import PatchLaw
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.multiscale.laws.worn_laws import RunningInLaws
from patchlaw.support import InputError


def law_of(form, *, touch=1e-3, end=9e-3, rows=12, **changes):
    closure = np.linspace(touch, end, rows)
    columns = {
        "closure": closure, "pressure": form(closure - touch), "approach": closure,
        "contact_area_fraction": 3.0 * (closure - touch), "contacts": np.arange(rows),
        "unresolved_displacement": 0.5 * (closure - touch),
    }  # fmt: skip
    made = LawRows(**(columns | changes))
    return PatchLaw(rows=made, first_touch=touch, initial_separation=0.02)


def hertz(indentation):
    return 4e3 * indentation**1.5


def test_hertz_law_is_exact_between_rows():
    law = law_of(hertz)
    closure = np.linspace(1e-3, 9e-3, 357)
    found = law.at(closure)
    pressure, stiffness = found.pressure, found.stiffness
    # p^(2/3) is a straight line: only round-off remains
    np.testing.assert_allclose(pressure, hertz(closure - 1e-3), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(stiffness, 6e3 * np.sqrt(closure - 1e-3), rtol=1e-12, atol=1e-9)


def test_stiffness_is_the_derivative_of_the_interpolant():
    law = law_of(lambda w: 4e3 * w**1.5 + 6e3 * np.maximum(w - 2e-3, 0) ** 1.5)
    closure, h = np.linspace(1.05e-3, 8.95e-3, 211), 1e-8
    difference = (law.pressure(closure + h) - law.pressure(closure - h)) / (2 * h)
    # second-order differences of a C¹ function: h times the jump of its second derivative
    np.testing.assert_allclose(law.stiffness(closure), difference, rtol=2e-5)


def test_zero_before_touch():
    found = law_of(hertz).at(np.array([-1.0, 0.0, 1e-3]))
    pressure, stiffness = found.pressure, found.stiffness
    assert not pressure.any()
    assert not stiffness.any()


def test_beyond_the_table_raises_with_the_range():
    with pytest.raises(InputError, match=r"0.0095: closure beyond .*up to 0.009 mm .first touch"):
        law_of(hertz).at(9.5e-3)


def test_extension_continues_the_tangent():
    law = law_of(hertz)
    closure = np.array([0.02, 0.5, 3.0])  # far beyond: Newton's first iterate may be anywhere
    np.testing.assert_allclose(law.pressure(closure), hertz(closure - 1e-3), rtol=1e-10)
    np.testing.assert_allclose(law.stiffness(closure), 6e3 * np.sqrt(closure - 1e-3), rtol=1e-10)


def test_open_patch():
    law = PatchLaw(rows=LawRows.none(), first_touch=5e-3, initial_separation=0.02)
    assert law.is_open
    assert not law.at(np.array([0.0, 5e-3])).pressure.any()
    assert law.at(1e-3).contact_area_fraction == 0.0
    assert law.at(1e-3).contacts == 0
    message = r"closure beyond the end of the patch law.*first touch at 0.005 mm"
    with pytest.raises(InputError, match=message):
        law.at(6e-3)


def test_contacts_are_those_of_the_row_before():
    law = law_of(hertz)
    spacing = law.rows.closure[1] - law.rows.closure[0]
    assert law.at([0.0, 1e-3, 1e-3 + 1.5 * spacing, 9e-3]).contacts.tolist() == [0, 0, 1, 11]


def test_area_and_separation():
    found = law_of(hertz).at([0, 4e-3])
    # a straight line through the rows: only round-off
    np.testing.assert_allclose(found.contact_area_fraction, [0.0, 9e-3], rtol=1e-12)
    np.testing.assert_allclose(found.separation, [0.02, 0.0175], rtol=1e-12)


@pytest.mark.parametrize(("changes", "text"), [
    ({"closure": np.linspace(1e-3, 9e-3, 11)}, "a patch law needs columns of one length"),
    ({"approach": np.r_[np.full(2, 1e-3), np.linspace(2e-3, 9e-3, 10)]},
     "a patch law needs a strictly increasing approach"),
    ({"pressure": np.r_[0.0, np.full(11, np.nan)]}, "a patch law needs a finite pressure"),
    ({"pressure": np.r_[0.0, -1.0, np.ones(10)]}, "needs a pressure without tension"),
    ({"pressure": np.linspace(1, 2, 12)}, "a patch law starts at zero pressure"),
])  # fmt: skip
def test_impossible_tables_are_refused(changes, text):
    with pytest.raises(InputError, match=text):
        law_of(hertz, **changes)


def test_a_single_row_is_no_law():
    names = ("closure", "pressure", "approach", "contact_area_fraction", "unresolved_displacement")
    one = {name: np.zeros(1) for name in names} | {"contacts": np.ones(1, int)}
    with pytest.raises(InputError, match=r"a patch law needs no row .open patch. or at least two"):
        law_of(hertz, **one)


def test_worn_laws_refuse_closures_beyond_their_end():
    laws = RunningInLaws([[law_of(hertz)], [law_of(hertz, end=8e-3)]], np.array([[0.0], [1e-3]]))
    patch, depth = np.zeros(2, np.intp), np.array([0.0, 1e-3])
    ends = np.array([9e-3, 8e-3])
    found = laws.at(patch, ends * (1.0 + 1e-13), depth)
    np.testing.assert_allclose(found.pressure, hertz(ends - 1e-3), rtol=1e-6)
    for place, value in ((0, "0.00900009"), (1, "0.00800008")):
        with pytest.raises(InputError, match=f"{value}.*: closure beyond the end of the law of a"):
            laws.at(patch[:1], ends[[place]] * (1.0 + 1e-5), depth[[place]])
