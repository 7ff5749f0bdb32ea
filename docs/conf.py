"""How Sphinx makes the site: of the pages in ``docs``, the README and the changelog.

The project's folder is the source, so that all pages keep their places and their links. Tables that
are made from the project (keys, columns, public names) are written to ``docs/_generated`` first:

    .venv/bin/python -m sphinx -W -c docs . docs/_build
"""

import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import generated  # noqa: E402
from docutils import nodes  # noqa: E402
from sphinx.application import Sphinx  # noqa: E402

project = "patchlaw"
author = "The patchlaw developers"
project_copyright = "2026, The patchlaw developers"
version = release = generated.version()
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "katex",
]
root_doc = "docs/index"
include_patterns = [
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/*.md", "docs/api/*.md",
    "demos/notebooks/*.ipynb",
]  # fmt: skip
exclude_patterns = [
    ".*", "results", "tests", "docs/_build", "docs/_generated", "docs/jupyter_execute",
]  # fmt: skip
needs_sphinx = "8.2"

# The repository has notebooks as scripts: small, compared line by line, run by the tests. They are
# executed when the site is made, so that what they show is what this version computes.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_block"]
myst_dmath_allow_space = False
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # headings of single pictures are small

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
python_use_unqualified_type_names = True
# Types of other packages and of the project's inner parts are named, but have no page here.
nitpicky = True
nitpick_ignore_regex = [("py:(class|exc|obj)", ".*")]
maximum_signature_line_length = 88
default_role = "py:obj"

html_theme = "furo"
html_title = f"patchlaw {release}"
html_math_renderer = "katex"
html_static_path = ["static"]
html_extra_path = ["index.html"]
html_css_files = ["style.css"]
html_copy_source = False
html_show_sourcelink = False

generated.write(HERE / "_generated")
generated.write_notebooks(HERE.parent / "demos" / "notebooks")


def _link_from_docs(app: Sphinx, path: Path, parent: str, content: list[str]) -> None:
    """Let links of the README start from ``docs`` where a page there includes it."""
    if path == Path("README.md"):
        content[0] = re.sub(r"\]\((?!https?:|#)", "](../", content[0])


def _keep_bars(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Keep bars in docstrings, which stand for absolute values, from naming substitutions."""
    for number, line in enumerate(lines):
        parts = line.split("``")  # every second part is literal
        parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
        lines[number] = "``".join(parts)


def _scale_pictures(app: Sphinx, tree: nodes.document) -> None:
    """Show pictures in one scale, so that their text is of one size; the widest fill a page."""
    for image in tree.findall(nodes.image):
        path = Path(app.srcdir, image["uri"])
        if path.suffix == ".png" and path.is_file() and "demos" in path.parts:
            pixels = int.from_bytes(path.read_bytes()[16:20], "big")
            image["width"] = f"{min(54.0, 54.0 * pixels / 1440.0):.1f}em"


def setup(app: Sphinx) -> None:
    """Connect what is done while pages are read."""
    app.connect("doctree-read", _scale_pictures)
    app.connect("autodoc-process-docstring", _keep_bars, priority=900)
    app.connect("include-read", _link_from_docs)
