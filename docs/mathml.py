"""Equations as MathML, which browsers show by themselves: no script, no network."""

from __future__ import annotations

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_TAG = re.compile(r"\\tag\{(.*?)\}")


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _display(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write an equation, its number from ``\\tag`` in brackets at the right."""
    text = node.astext()
    number = "".join(f'<span class="number">({tag})</span>' for tag in _TAG.findall(text))
    plain = _TAG.sub("", text).replace("{aligned}", "{align*}")
    translator.body.append(
        f'<div class="equation">{convert(plain, display="block")}{number}</div>\n'
    )
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
