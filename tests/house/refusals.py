"""Finds every text that the packages refuse with in their source, and lists them on a page.

``python tests/house/refusals.py`` writes the page anew.
"""

import ast
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "demos" / "refusals.md"
PACKAGES = ("geometry", "micro", "macro", "multiscale")
CODES = {"InputError": 2, "NotConverged": 3, "Stopped": 4, "NotWritten": 5, "OutOfMemory": 5}
OF_A_SCENE = {"quantities.py", "sections.py", "scene.py", "scene_files.py"}  # by way of pydantic
GAP = "…"  # stands for what depends on the case


@dataclass(frozen=True, order=True)
class Refusal:
    """A text with which a module refuses something; gaps stand for what depends on the case."""

    code: int
    module: str
    text: str
    more: str
    line: int

    @property
    def parts(self):
        """The fixed parts of the text."""
        return [part.strip() for part in self.text.split(GAP) if part.strip()]


def text_of(node, bound):
    """Return the text of an expression, given those of names; what is unknown is a gap."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.Name):
        return bound.get(node.id, GAP)
    if isinstance(node, ast.JoinedStr):
        inner = [
            part.value if isinstance(part, ast.FormattedValue) else part for part in node.values
        ]
        return "".join(text_of(part, bound) for part in inner)
    return GAP


def bindings(function, tree):
    """Yield what names of a function are bound to together, by assignment or row of a loop."""
    pairs = []
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            pairs += [(target, node.value) for target in node.targets]
        elif isinstance(node, ast.For | ast.comprehension):
            pairs += [(node.target, row) for row in rows_of(node.iter, tree)]
    for target, value in pairs:
        both = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            both = list(zip(target.elts, value.elts, strict=False))
        texts = {
            name.id: text_of(text, {})
            for name, text in both
            if isinstance(name, ast.Name) and isinstance(text, ast.Constant | ast.JoinedStr)
        }
        if texts:
            yield texts


def rows_of(loop, tree):
    """Return what a loop goes over: elements of a tuple, or what a function here yields."""
    if isinstance(loop, ast.Tuple | ast.List):
        return loop.elts
    called = getattr(loop, "func", None)
    name = getattr(called, "attr", getattr(called, "id", None))
    return [
        inner.value
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name == name
        for inner in ast.walk(node)
        if isinstance(inner, ast.Yield)
    ]


def worlds(nodes, function, tree):
    """Return the bindings that say most of the names in some expressions; one that says nothing."""
    used = {part.id for node in nodes for part in ast.walk(node) if isinstance(part, ast.Name)}
    alone, rows = {}, []
    for texts in bindings(function, tree):
        if len(used & set(texts)) > 1:
            rows.append(texts)
        elif used & set(texts):
            for name, text in texts.items():
                alone.setdefault(name, []).append(text)
    many = [{name: text} for name, texts in alone.items() if len(texts) > 1 for text in texts]
    single = {name: texts[0] for name, texts in alone.items() if len(texts) == 1}
    return [single | row for row in rows or many or [{}]]


@cache
def parsed(path):
    """Return the syntax tree of a module."""
    return ast.parse(path.read_text(encoding="utf-8"))


def calls_in(tree):
    """Yield the calls in a module, each once, with the innermost function that it stands in."""
    inner = {}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            inner |= {node: function for node in ast.walk(function) if isinstance(node, ast.Call)}
    yield from ((node, function) for node, function in inner.items() if node.args)


def passed_on(tree, names):
    """Return functions that refuse with a problem they are told: its place, the call."""
    found = {"finite_pair": (1, None)}  # of geometry.checks, for all
    for node, function in calls_in(tree):
        arguments = [part.arg for part in function.args.args if part.arg != "self"]
        told = {part.id for part in ast.walk(node.args[0]) if isinstance(part, ast.Name)}
        if getattr(node.func, "id", "") in names and "problem" in told & set(arguments):
            found[function.name] = (arguments.index("problem"), node)
    return found


def refusals(path):
    """Yield what a module refuses with."""
    tree = parsed(path)
    names = set(CODES) | ({"ValueError"} if path.name in OF_A_SCENE else set())
    forwarding = passed_on(tree, names)
    for node, function in calls_in(tree):
        called = getattr(node.func, "attr", getattr(node.func, "id", ""))
        told = {word.arg: word.value for word in node.keywords}
        told_of = {part.id for part in ast.walk(node.args[0]) if isinstance(part, ast.Name)}
        if called in names and not (function.name in forwarding and "problem" in told_of):
            more = told.get("remedy" if called == "NotConverged" else "allowed", ast.Constant(""))
            found, code = [node.args[0], more], CODES.get(called, 2)
            for bound in worlds(found, function, tree):
                yield from refusal(path, node, code, *(text_of(part, bound) for part in found))
        elif called in forwarding and len(node.args) > forwarding[called][0]:
            place, inside = forwarding[called]
            found = [node.args[place], told.get("allowed", ast.Constant(""))]
            for bound in worlds(found, function, tree):
                text, more = (text_of(part, bound) for part in found)
                if inside is not None and text != GAP:
                    text = text_of(inside.args[0], {"text": text, "problem": text})
                yield from refusal(path, node, 2, text, more)


def refusal(path, node, code, text, more):
    """Yield a refusal, if its text says something."""
    text, _, inside = text.partition(" (allowed: ")  # errors for pydantic's ears have both in one
    more = more or inside.removesuffix(")")
    if len(text.replace(GAP, "").strip()) > 3:
        module = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else path.name
        yield Refusal(code, module, text, "" if more == GAP else more, node.lineno)


def all_refusals():
    """Return what all packages refuse with, in order, each text of a module once."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for one in refusals(path):
                found.setdefault((one.code, one.module, one.text), one)
    return sorted(found.values())


HEADS = {
    2: """## 2: the input is wrong

Nothing is written. The whole message is `file: key = value: text (allowed: what would do)`, with
the parts that are known; the keys of a scene and what each may be are in `patchlaw schema`. What is
simply of the wrong type or out of a key's range is told in pydantic's words: *must be greater than
0*, *is required and missing*.
""",
    3: """## 3: not converged

The load steps up to there are written. The whole message is
`text did not converge: REASON after N iterations; remedy`.
""",
    4: """## 4, 129, 130, 143: stopped

The load steps up to there are written, and the last of them can be gone on from. With 4 ends what
was told to stop in time (`--max-time`, SIGUSR1), with 129 what SIGHUP, with 130 what SIGINT and
with 143 what SIGTERM stopped.
""",
    5: """## 5: the system refuses

A file or the output cannot be written, or memory ran out. Nothing half-written stands under its
name, and the load steps up to there are in the checkpoint.
""",
}
INTRO = """# Everything that patchlaw refuses

By exit code, then by the module that refuses, every text in the source. Gaps (…) stand for what
depends on the case: numbers, names, what the system said. Exit code 1 is a bug and has no text of
its own.

Written by `tests/house/refusals.py`; a test keeps it true, and another one that each of these texts
is pinned by a test.
"""


def page():
    """Return the page that lists all refusals."""
    parts = [INTRO]
    for code, of_code in groupby(all_refusals(), key=lambda one: one.code):
        parts.append(HEADS[code])
        for module, found in groupby(of_code, key=lambda one: one.module):
            subject = ast.get_docstring(parsed(ROOT / module)).partition("\n")[0]
            parts.append(f"**{module}**: {subject}\n")
            parts.append("".join(f"* {shown(one)}\n" for one in found))
    return "\n".join(parts)


def shown(one):
    """Return a refusal as a line of Markdown."""
    join = {2: "; allowed: ", 3: "; remedy: "}.get(one.code, "")
    text = f"`{one.text.replace('`', chr(39))}`"
    return f"{text}{join}{one.more.replace('*', chr(92) + '*')}" if one.more else text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
