"""Every text with which the packages refuse something is pinned by a test."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("geometry", "micro", "macro", "multiscale")
ERRORS = {"InputError", "NotConverged", "NotWritten"}
OF_A_SCENE = {"quantities.py", "sections.py", "scene.py", "scene_files.py"}  # by way of pydantic
LENGTH = 18  # characters of a message that a test must have in common with it


def literal_parts(node):
    """Return the fixed parts of a text in the source, none when it is made elsewhere."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    if isinstance(node, ast.JoinedStr):
        return [part.value for part in node.values if isinstance(part, ast.Constant)]
    return []


def assigned(tree):
    """Return the texts that names are given anywhere in a module."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                pairs = [(target, node.value)]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = list(zip(target.elts, node.value.elts, strict=False))
                for name, value in pairs:
                    if isinstance(name, ast.Name) and literal_parts(value):
                        found.setdefault(name.id, []).append(value)
    return found


def messages(path):
    """Yield line and fixed parts of every text that a module refuses with."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = assigned(tree)
    names = ERRORS | ({"ValueError"} if path.name in OF_A_SCENE else set())
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        if getattr(node.func, "id", "") not in names or not node.args:
            continue
        first = node.args[0]
        given = texts.get(first.id, []) if isinstance(first, ast.Name) else [first]
        for value in given:
            parts = sorted((part.strip() for part in literal_parts(value)), key=len)
            if parts and len(parts[-1]) > 3:
                yield node.lineno, [part for part in parts if len(part) >= LENGTH] or parts[-1:]


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
        f"{path.name}:{line}: {' … '.join(parts)}"
        for path in sorted((ROOT / package).rglob("*.py"))
        for line, parts in messages(path)
        if not any(pieces(part, LENGTH) & known or part in pinned for part in parts)
    ]
    assert not missing, "\n".join(missing)


def test_the_search_finds(tmp_path):
    module = tmp_path / "module.py"
    module.write_text(
        "def f(x):\n"
        "    problem, allowed = f'the size {x} does not fit at all', 'more'\n"
        "    raise InputError(problem, allowed=allowed)\n"
        "def g():\n"
        "    raise NotConverged('the balance', reason='stagnation')\n"
    )
    assert list(messages(module)) == [(3, ["does not fit at all"]), (5, ["the balance"])]
