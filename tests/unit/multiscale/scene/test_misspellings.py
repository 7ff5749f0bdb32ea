"""Misspelt keys and units are refused, and the right ones offered."""

from hypothesis import given, settings

from benchmarks import misspellings

FEW = settings(max_examples=60, derandomize=True, database=None, deadline=None)


@FEW
@given(misspellings.keys())
def test_misspelt_keys(drawn):
    assert misspellings.key_was_offered(drawn) != "taken"


@FEW
@given(misspellings.units())
def test_units_of_the_wrong_case(drawn):
    assert misspellings.unit_was_offered(drawn) in ("read", "offered")
