"""What is given to a public name by mistake is refused in words that name the argument."""

import inspect
from dataclasses import fields

import numpy as np
import pytest
from helpers.wrong_arguments import BAD, CALLS, MODEL, history, made, table

import patchlaw
from patchlaw import ContactHistory, Control, InputError, PatchGrid, difference
from patchlaw.support import errors


def refused(use, base, name, value):
    """Call with one argument replaced; whatever is not refused in words fails the test."""
    with pytest.raises(InputError) as found:
        use(**(base | {name: value}))
    text = str(found.value)
    assert name in text or name.replace("_", " ") in text, text
    assert "\n" not in text and len(text) < 600


OF_PROGRAMS = set(dir(errors))
"""Errors, which the program makes."""


@pytest.mark.long
@pytest.mark.parametrize("call", CALLS)
def test_mistakes_are_refused_in_words_that_name_the_argument(call):
    use, base, arguments = CALLS[call]
    given = made(base)
    for name, fine in arguments.items():
        for label, value in BAD.items():
            if label not in fine:
                refused(use, given, name, value)


def results():
    """Yield results, which users rarely make themselves."""
    contact = ContactHistory(records=history().contact_records)
    one = difference(history(), history())
    yield from (history(), history()[0], table(), contact, one)


def test_records_of_results_are_made_of_what_they_say():
    for one in results():
        whole = {field.name: getattr(one, field.name) for field in fields(one)}
        assert type(one)(**whole) is not None
        for name in whole:
            refused(type(one), whole, name, object())


def test_every_argument_of_every_public_name_is_tried():
    known = {type(one).__name__ for one in results()} | {"Comparison", "BodyFields", "NaturalModes"}
    for name in set(dir(patchlaw)) - OF_PROGRAMS - known:
        tried = {
            argument
            for call, (_, _, arguments) in CALLS.items()
            if call.partition(" of ")[0] == name
            for argument in arguments
        }
        sections = () if name == "Scene" else inspect.signature(getattr(patchlaw, name)).parameters
        assert set(sections) <= tried | {"steps"}, name


def test_nobody_need_be_told_of_progress():
    told = [
        inspect.signature(use).parameters[name].default
        for use, _, arguments in CALLS.values()
        for name in arguments.keys() & {"observe", "begun"}
    ]
    assert told == [None] * 7  # of six functions, so that what wraps them passes None on


@pytest.mark.parametrize("value", [2, np.float32(2.0), np.int64(2), np.array(2.0)])
def test_numbers_of_numpy_are_numbers(value):
    assert Control(force=value) == Control(force=2.0)
    assert MODEL.solve_force(value).force == pytest.approx(2.0, rel=1e-6)  # the model's 1e-8


def test_lists_and_arrays_are_pairs():
    whole = PatchGrid(grid=(2, 3), lengths=(1.0, 2.0))
    assert PatchGrid(grid=np.array([2, 3]), lengths=[1, 2]) == whole
    assert Control(force=1.0, tilt=np.array([0.0, 1e-3])) == Control(force=1.0, tilt=(0.0, 1e-3))
