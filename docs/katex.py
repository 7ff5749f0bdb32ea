"""Equations by KaTeX, from Debian's package: a page fetches nothing from a network.

What is between the tags is TeX, which ``static/equations.js`` has KaTeX show.
"""

from __future__ import annotations

import shutil
from html import escape
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator

FOLDER = Path("/usr/share/javascript/katex")


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(f'<span class="equation">{escape(node.astext())}</span>')
    raise nodes.SkipNode


def _display(translator: HTML5Translator, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="equation">{escape(node.astext())}</div>\n')
    raise nodes.SkipNode


def _copy(app: Sphinx, failure: Exception | None) -> None:
    """Put KaTeX and its fonts beside the pages."""
    if failure is None and app.builder.format == "html":
        target = app.outdir / "_static" / "katex"
        shutil.copytree(FOLDER / "fonts", target / "fonts", dirs_exist_ok=True)
        for name in ("katex.js", "katex.css"):
            shutil.copy(FOLDER / name, target)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    if not FOLDER.is_dir():
        raise ExtensionError(f"{FOLDER} is missing: ./setup.sh --docs installs libjs-katex")
    app.add_html_math_renderer("katex", (_inline, None), (_display, None))
    app.add_css_file("katex/katex.css")
    app.add_js_file("katex/katex.js")
    app.add_js_file("equations.js")
    app.connect("build-finished", _copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
