"""Statements in functions that a command executes, by folder, module and function.

    python benchmarks/executed_statements.py [--functions N] [run SCENE --out DIR]

Without words it runs a concurrent scene of 32² cells without figures and report, into a folder that
is removed. Each statement counts once, however often it is executed. The cache is off. Takes some
seconds.
"""

import ast
import os
import sys
import tempfile
import threading
from collections import Counter, defaultdict
from pathlib import Path

FOLDERS = ("geometry", "macro", "micro", "multiscale", "support")
PHYSICS = FOLDERS[:3]
SCENE = """
[surface]
spectrum = { hurst = 0.8, waves = [2, 8], rms_slope = 0.1, seed = 1 }
grid = [32, 32]
lengths = ["1 mm", "1 mm"]
[block]
young_modulus = "4 GPa"
poisson_ratio = 0.15
[coupling]
kind = "concurrent"
[load]
approach = "4 um"
steps = 4
[output]
figures = false
report = false
"""
ROOT = Path(__file__).resolve().parents[1]


def traced(words):
    """Return the lines that a command executes, by file of these folders."""
    lines = defaultdict(set)

    def of_line(frame, event, _):
        if event == "line":
            lines[frame.f_code.co_filename].add(frame.f_lineno)
        return of_line

    def of_call(frame, event, _):
        file = frame.f_code.co_filename
        ours = file.endswith(".py") and any(file.startswith(f"{ROOT / one}/") for one in FOLDERS)
        return of_line if ours else None

    os.environ["PATCHLAW_CACHE"] = "off"
    threading.settrace(of_call)
    sys.settrace(of_call)
    from patchlaw.multiscale.cli.command_line import main

    code = main(words)
    sys.settrace(None)
    threading.settrace(None)
    if code:
        sys.exit(code)
    return lines


def executed(node, lines, function=""):
    """Yield the function of each statement in functions that begins in one of some lines."""
    for child in ast.iter_child_nodes(node):
        text = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
        if function and isinstance(child, ast.stmt) and not text:
            body = getattr(child, "body", None)
            ends = body[0].lineno if isinstance(body, list) else child.end_lineno + 1
            if not lines.isdisjoint(range(child.lineno, max(ends, child.lineno + 1))):
                yield function
        name = f"{function}.{child.name}" if isinstance(child, ast.FunctionDef) else function
        yield from executed(child, lines, name)


def main(words):
    """Count and print."""
    shown = int(words.pop(0)) if words[:1] == ["--functions"] and words.pop(0) else 25
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "scene.toml")
        scene.write_text(SCENE, encoding="utf-8")
        lines = traced(words or ["run", str(scene), "--out", f"{folder}/out"])
    folders, modules, functions = Counter(), Counter(), Counter()
    for file, those in lines.items():
        name = str(Path(file).relative_to(ROOT))
        for function in executed(ast.parse(Path(file).read_text(encoding="utf-8")), those):
            folders[name.partition("/")[0]] += 1
            modules[name] += 1
            functions[f"{name} {function.strip('.')}"] += 1
    whole, physics = sum(folders.values()), sum(folders[one] for one in PHYSICS)
    for title, counts in (("functions", functions), ("modules", modules), ("folders", folders)):
        print(f"\n{title}")
        for name, count in counts.most_common(shown):
            print(f"{count:6} {name}")
    print(
        f"\n{whole} statements in {len(modules)} modules and {len(functions)} functions, ", end=""
    )
    print(f"{physics / whole:.0%} of them in geometry, macro and micro")


if __name__ == "__main__":
    main(sys.argv[1:])
