"""Nothing that a file or a word says is ever run: no eval, no pickles, no shell."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RUNS_TEXT = {"eval", "exec", "compile", "__import__"}
RUNS_FILES = {
    ("pickle", "load"), ("pickle", "loads"), ("pickle", "Unpickler"), ("marshal", "load"),
    ("marshal", "loads"), ("shelve", "open"), ("os", "system"), ("os", "popen"),
    ("np", "fromregex"), ("yaml", "load"), ("runpy", "run_path"),
}  # fmt: skip


def dangers(tree):
    """Yield what in a module could run what data say."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        function = node.func
        if isinstance(function, ast.Name) and function.id in RUNS_TEXT:
            yield function.id
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            if (function.value.id, function.attr) in RUNS_FILES:
                yield f"{function.value.id}.{function.attr}"
            stated = any(keyword.arg == "allow_pickle" for keyword in node.keywords)
            if (function.value.id, function.attr) == ("np", "load") and not stated:
                yield "np.load"  # by default it loads none either, in releases of today
        for keyword in node.keywords:
            allowed = isinstance(keyword.value, ast.Constant) and keyword.value.value is False
            if keyword.arg in ("shell", "allow_pickle") and not allowed:
                yield keyword.arg


@pytest.mark.parametrize("package", ["support", "geometry", "micro", "macro", "multiscale"])
def test_no_module_runs_data(package):
    modules = list((ROOT / package).rglob("*.py"))
    assert modules
    for path in modules:
        assert list(dangers(ast.parse(path.read_text(encoding="utf-8")))) == [], path


@pytest.mark.parametrize(
    "text",
    [
        "eval('1')",
        "exec(text)",
        "pickle.load(file)",
        "os.system('ls')",
        "subprocess.run('ls', shell=True)",
        "np.load(path)",
        "np.lib.format.read_array(file, allow_pickle=True)",
    ],
)
def test_the_search_finds(text):
    assert list(dangers(ast.parse(text)))
