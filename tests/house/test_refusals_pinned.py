"""Every text with which the packages refuse is pinned by a test, and stands on the page."""

import ast
from pathlib import Path

import pytest
from refusals import PACKAGES, PAGE, ROOT, all_refusals, page, refusals

LENGTH = 24  # characters of a message that a test must have in common with it
WHOLE = 15  # or all of a part of it, between two gaps, that is not shorter


def pieces(text, length):
    """Return all parts of a text of one length."""
    return {text[at : at + length] for at in range(len(text) - length + 1)}


@pytest.fixture(scope="module")
def pinned():
    """All texts in the tests, but for docstrings, with the signs of regular expressions taken."""
    found = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        if path == Path(__file__):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                node.value = ast.Constant(value=None)
        found += [
            node.value.replace("\\", "")
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        ]
    return "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_refusal_is_pinned(package, pinned):
    known = pieces(pinned, LENGTH)
    missing = [
        f"{one.module}:{one.line}: {one.text}"
        for one in all_refusals()
        if one.module.startswith(f"{package}/")
        and not any(pieces(part, LENGTH) & known for part in one.parts)
        and not any(part in pinned for part in one.parts if len(part) >= WHOLE)
        and max(one.parts, key=len) not in pinned
    ]
    assert not missing, "\n".join(missing)


def test_the_page_is_complete():
    assert PAGE.read_text(encoding="utf-8") == page(), "run tests/house/refusals.py"


def test_the_search_finds(tmp_path):
    module = tmp_path / "module.py"
    module.write_text(
        "def f(x):\n"
        "    problem, allowed = f'the size {x} does not fit at all', 'more'\n"
        "    raise InputError(problem, allowed=allowed)\n"
        "def g():\n"
        "    raise NotConverged('the balance', reason='stagnation', remedy='less')\n"
        "def h():\n"
        "    for wrong, problem, allowed in ((1, 'is odd', 'even'), (2, 'is even', f'{x} odd')):\n"
        "        raise InputError(problem, allowed=allowed)\n"
        "def _refused(problem):\n"
        "    return InputError(f'{problem}; go away')\n"
        "def i():\n"
        "    raise _refused('a stranger')\n"
        "def j():\n"
        "    finite_pair(x, 'no pair')\n"
        "def k(path):\n"
        "    raise NotWritten(path)\n"
    )
    found = {(one.code, one.text, one.more) for one in refusals(module)}
    assert found == {
        (2, "the size … does not fit at all", "more"), (3, "the balance", "less"),
        (2, "is odd", "even"), (2, "is even", "… odd"), (2, "a stranger; go away", ""),
        (2, "no pair", ""),
    }  # fmt: skip
