"""Prints every text with which the packages refuse something, by exit code and module.

``python docs/refusals.py > refusals.md`` makes a page of Markdown.
"""

import ast
import sys
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("support", "geometry", "micro", "macro", "multiscale")
CODES = {"InputError": 2, "NotConverged": 3, "Stopped": 4, "NotWritten": 5, "OutOfMemory": 5}
PROBLEMS = ("problem", "text", "message")  # names that the texts of errors are bound to
GAP = "…"  # stands for what depends on the case
HEADS = {
    2: """## 2: the input is wrong

Nothing is written. The whole message is `file: key = value: text (allowed: what would do)`, with
the parts that are known. The keys of a scene and their values are in `patchlaw schema`. Values of
the wrong type or out of a key's range are refused in pydantic's words: *must be greater than 0*.
""",
    3: """## 3: not converged

The load steps up to there are written. The whole message is
`text did not converge: REASON after N iterations; remedy`.
""",
    4: """## 4, 129, 130, 143: stopped

The load steps up to there are written, and the run can be resumed. The exit code is 4 after
`--max-time` and SIGUSR1, 129 after SIGHUP, 130 after SIGINT and 143 after SIGTERM.
""",
    5: """## 5: the system refuses

A file or the output cannot be written, or memory ran out. Nothing half-written stands under its
name, and the load steps up to there are in the checkpoint.
""",
}
INTRO = """# Every text with which patchlaw refuses something

By exit code and module. Gaps (…) stand for numbers, names and what the system said. Exit code 1 is
a bug and has no text of its own.
"""


def text_of(node):
    """Return the text of an expression, with gaps for what depends on the case."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(text_of(part) for part in node.values)
    return GAP


def texts_in(tree):
    """Yield exit codes and texts: arguments of errors, and what is bound to `PROBLEMS`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if name in CODES:
                yield CODES[name], text_of(node.args[0])
            elif name == "ValueError":  # becomes an error of input when a scene is read
                yield 2, text_of(node.args[0])
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name) and target.id in PROBLEMS:
                    yield 2, text_of(node.value)


def page():
    """Return the page of all texts."""
    found = {
        (code, str(path.relative_to(ROOT)), text)
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        for code, text in texts_in(ast.parse(path.read_text(encoding="utf-8")))
        if len(text.replace(GAP, "").strip()) > 3
    }
    parts = [INTRO]
    for code, of_code in groupby(sorted(found), key=lambda one: one[0]):
        parts.append(HEADS[code])
        for module, texts in groupby(of_code, key=lambda one: one[1]):
            lines = [f"* `{text.replace('`', chr(39))}`\n" for _, _, text in texts]
            parts += [f"**{module}**\n", "".join(lines)]
    return "\n".join(parts)


if __name__ == "__main__":
    sys.stdout.write(page())
