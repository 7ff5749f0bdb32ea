"""One page of figures: what a paper claims of each, and what a run of the demos finds."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

HEAD = """<!doctype html><html lang="en"><meta charset="utf-8">
<title>Waddad et al. 2016, drawn anew</title>
<style>body{font:16px/1.45 sans-serif;max-width:64em;margin:2em auto;padding:0 1em}
img{max-width:100%}</style><h1>Waddad et al. 2016, drawn anew</h1>
<p>A multiscale method for frictionless contact mechanics of rough surfaces,
doi 10.1016/j.triboint.2015.12.023. Every number below was computed by the run.
"""


class Page:
    """Figures with claim and finding; demos that share a folder share its ``index.html``."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.store = folder, folder / "claims.json"
        folder.mkdir(parents=True, exist_ok=True)

    def add(self, name: str, title: str, figure: Figure, claim: str, found: str) -> None:
        """Save a figure as PNG, print the finding, and write the page anew."""
        known = json.loads(self.store.read_text("utf-8")) if self.store.exists() else {}
        picture = name.lower().replace(" ", "_") + ".png"
        figure.savefig(self.folder / picture)
        print(f"{name}, {title}: {found}")
        known[name] = [picture, title, claim, found]
        self.store.write_text(json.dumps(known, ensure_ascii=False), "utf-8")
        parts = [HEAD]
        for heading in sorted(known, key=lambda text: (len(text), text)):  # 9 before 14
            file, subject, said, seen = map(escape, known[heading])
            parts.append(f"<h2>{heading}: {subject}</h2><p><b>The paper:</b> {said}")
            parts.append(f'<p><b>This run:</b> {seen}<p><img src="{file}" alt="{subject}">')
        (self.folder / "index.html").write_text("\n".join(parts), "utf-8")
