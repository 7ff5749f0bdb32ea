"""What the site makes from the project: tables of keys, columns, public names; notebooks."""

from __future__ import annotations

import inspect
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path

from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.results.contacts import FIELDS, ContactRecord
from patchlaw.multiscale.scene.schema import Key, scene_keys

ROOT = Path(__file__).parents[1]
SCRIPTS = {"foot": "benchmarks/body_reference.py"}
"""Scripts of pictures that are no demos."""
FOLDERS = ("multiscale", "micro", "macro", "geometry")
PACKAGES = ("patchlaw", *(f"patchlaw.{folder}" for folder in FOLDERS))
"""Packages with public names, from the top down; a name is described in the first that has it."""


def version() -> str:
    """Return the version that ``pyproject.toml`` states."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return settings["project"]["version"]


def write(folder: Path) -> None:
    """Write all pages; those that did not change keep their time, so that nothing is built anew.

    Args:
        folder: Where they go; made when missing.
    """
    folder.mkdir(exist_ok=True)
    pages = {
        "scene_keys.md": scene_key_tables(),
        "history_columns.md": history_columns(),
        "contact_maps.md": contact_maps(),
        "hard_cases.md": hard_cases(),
        "gallery.md": gallery(),
        **{f"{package.rpartition('.')[2]}.md": names_of(package) for package in PACKAGES},
    }
    for name, text in pages.items():
        _write(folder / name, text)


def write_notebooks(folder: Path) -> None:
    """Write a notebook beside every script of a folder, with a link to what came of its execution.

    Args:
        folder: The folder; the scripts are in jupytext's percent format.
    """
    import jupytext
    from nbformat.v4 import new_markdown_cell

    for script in sorted(folder.glob("*.py")):
        path = script.with_suffix(".ipynb")
        notebook = jupytext.read(script)
        links = (
            f"[The script](path:{script.name}) · {{nb-download}}`executed notebook <{path.name}>`"
        )
        notebook.cells.append(new_markdown_cell(links))
        for number, cell in enumerate(notebook.cells):
            cell["id"] = f"cell-{number}"  # the same every time, and not drawn
        _write(path, jupytext.writes(notebook, fmt="ipynb"))


def _write(path: Path, text: str) -> None:
    """Write a file, unless it holds the text already."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def _table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    head = tuple(heading)
    lines = [head, ("---",) * len(head), *rows]
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*")


def scene_key_tables() -> str:
    """Return a table for every section of a scene, from the schema that checks scene files.

    A section that has the keys of an earlier one names them without saying all about them again.
    """
    known: dict[tuple[str, ...], str] = {}
    parts = []
    for section in (key for key in scene_keys().values() if "." not in key.name):
        heading = f"## `[{section.name}]`" if section.is_section else f"## `{section.name}`"
        rows, repeated = [], []
        for key in _keys_of(section):
            said = (key.meaning, key.values, key.default)
            if known.setdefault(said, key.name) != key.name and not key.is_section:
                repeated.append((key.name, known[said]))
            elif not key.is_section:
                rows.append((f"`{key.name}`", key.meaning, key.values, f"`{_default(key)}`"))
        parts.append(f"{heading}\n\n{section.meaning * section.is_section}\n")
        parts.append(_table(("key", "meaning", "values", "default"), rows))
        if repeated:
            same = "".join(f"* `{name}`: as `{first}`\n" for name, first in repeated)
            parts.append(f":::{{dropdown}} Keys as in an earlier section\n{same}:::\n")
    return "\n".join(parts)


def _keys_of(section: Key) -> Iterator[Key]:
    """Yield the keys of a section and of the sections in it; a key that is none, itself."""
    if not section.is_section:
        yield section
    yield from (key for key in scene_keys().values() if key.name.startswith(f"{section.name}."))


def _default(key: Key) -> str:
    return "required" if key.required else key.default


def history_columns() -> str:
    """Return the table of the columns of ``history.csv``, from where they are declared."""
    rows = ((f"`{one.name}`", one.meaning, one.unit or "–") for one in COLUMNS)
    return _table(("column", "meaning", "unit"), rows)


def contact_maps() -> str:
    """Return the table of the datasets of ``contact.h5``, from the record that reads them."""
    text = (inspect.getdoc(ContactRecord) or "").partition("Attributes:\n")[2]
    said = {name: " ".join(words.split()) for name, words in
            re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE)}  # fmt: skip
    return _table(("dataset", "meaning"), ((f"`{name}`", said[name]) for name in FIELDS))


def gallery() -> str:
    """Return the pictures of all pages in their order, each with its script and its discussion."""
    entries: dict[str, str] = {}
    order = re.findall(r"^(\w+)$", (ROOT / "docs" / "index.md").read_text("utf-8"), re.MULTILINE)
    for page in (name for name in order if (ROOT / "docs" / f"{name}.md").is_file()):
        text = (ROOT / "docs" / f"{page}.md").read_text("utf-8") if page != "demos" else ""
        part = ""
        for line in text.splitlines():
            if line.startswith("##"):
                part = "#" + re.sub(r"[^\w\- ]", "", line.lstrip("# ").lower()).replace(" ", "-")
            elif shown := re.match(r"\s*!\[(.+)\]\(\.\./(demos/\w+/(\w+)\.png)\)", line):
                title, picture, stem = shown.groups()
                script = SCRIPTS.get(stem) or picture.replace("/pictures", "").replace(
                    ".png", ".py"
                )
                entries[picture] = (
                    f"### {title}\n\n![{title}](../{picture})\n\n"
                    f"[`{script.removeprefix('demos/')}`](../{script}); "
                    f"[discussed here]({page}.md{part})\n"
                )
    return "\n".join(entries.values())


def hard_cases() -> str:
    """Return the table of the hard cases, from where the demo declares them."""
    sys.path.insert(0, str(ROOT / "demos"))
    for module in ("hard.blocks_and_loads", "hard.surfaces"):
        import_module(module)  # which fills the list
    cases = sorted(import_module("hard.bench").CASES, key=lambda case: case.number)
    rows = ((str(case.number), case.hard, case.holds, f"{case.bound:g}") for case in cases)
    return _table(("kind", "what is difficult", "what must hold", "bound"), rows)


def public_names(package: str) -> list[str]:
    """Return the public names that are described with a package, not with one above it."""
    above = PACKAGES[: PACKAGES.index(package)]
    described = {id(_named(other, name)) for other in above for name in _all(other)}
    return [name for name in _all(package) if id(_named(package, name)) not in described]


def _all(package: str) -> list[str]:
    return sorted(import_module(package).__all__, key=str.lower)


def _named(package: str, name: str) -> object:
    return getattr(import_module(package), name)


def names_of(package: str) -> str:
    """Return a page on the public names of a package: a table of them, then each in full."""
    rows, blocks = [], []
    for name in public_names(package):
        thing, path = _named(package, name), f"{package}.{name}"
        if not callable(thing):
            blocks.append(f".. autodata:: {path}\n")
            continue
        kind = "class" if inspect.isclass(thing) else "function"
        says = (inspect.getdoc(thing) or "").partition("\n")[0].replace("``", "`")
        rows.append((f"{{py:obj}}`{path}`", says))
        blocks.append(f".. auto{kind}:: {path}\n")
    body = "\n".join(blocks)
    return f"{_table(('name', 'purpose'), rows)}\n```{{eval-rst}}\n{body}```\n"
