"""Measures the times of the README and of ``docs/speed.md`` anew in one go, and writes them there.

Run by hand on an idle machine, half an hour:

    .venv/bin/python benchmarks/published_times.py --peers peers/bin/python

Without ``--peers``, whose environment `half_space_against_peers.py` describes, the tables beside
peers stay as they are; ``--only whole laws`` takes tables by name. Every table is the excerpt of
one benchmark in this folder, which prints more. What other pages repeat of the tables is checked by
``tests/house/test_figures_on_pages.py``.
"""

import argparse
import csv
import os
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from math import ceil
from pathlib import Path

from json_rows import kept

ROOT = Path(__file__).parents[1]
README, SPEED = ROOT / "README.md", ROOT / "docs" / "speed.md"
COMPARED = ROOT / "demos" / "data" / "compare_paper.csv"
ENVIRONMENT = os.environ | {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "PYTHONPATH": str(ROOT),
}
ENVIRONMENT.pop("PYTHONDONTWRITEBYTECODE", None)  # users import compiled modules

README_ROWS = {
    "circular asperities, no block": ("analytic, circular",),
    "`concurrent`, 64² and 128² heights": (
        "concurrent, half-space 64 × 64",
        "concurrent, half-space 128 × 128",
    ),
    "`consistent`, 128² heights, 16 patches": ("consistent, 4 × 4 patches, half-space 128 × 128",),
    "`isolated`, 16 patches, 40 000 hexahedra": (
        "the scene as it is: isolated, 4 × 4 patches, circular, 40 × 40 × 25 elements",
    ),
    "reference, one mesh of 78 000 unknowns": ("reference, 1 mesh, 10.4 µm",),
}
"""Rows of the README's table of times, and the configurations that they show."""
PARTS = {
    "pad, 42:1": ("brake pad, moduli 42 : 1", "linear tetrahedra", 1.8),
    "pad, P2": ("brake pad, 420 : 1", "quadratic tetrahedra", 1.7),
    "pad, Q1": ("brake pad, 420 : 1, on rollers", "linear hexahedra", 1.0),
    "flange": ("flange", "linear tetrahedra", 1.0),
    "ring 8:1, Q1": ("seal ring on rollers", "hexahedra of 8 : 1", 1.0),
    "ring 20:1, Q1": ("seal ring on rollers", "hexahedra of 20 : 1", 1.0),
}
"""Parts of `body_solvers.py`: what they are, their cells, and the scale of their mesh."""
PHASES = {
    "surface, laws, set-up": ("surface", "load estimate", "laws", "block", "contact"),
    "errors": ("check",),
    "load steps": ("load steps",),
    "tables, figures, report": ("output", "writing", "other"),
    "imports": ("imports",),
    "**whole**": ("whole",),
}
"""Phases of a run as the table groups them."""


def rounded(value: float) -> str:
    """Return a time as tables show it: no decimals from ten on, one from one on, else two."""
    return f"{value:.{0 if value >= 10.0 else 1 if value >= 1.0 else 2}f}"


def percent(value: float) -> str:
    """Return an error as tables show it, in per cent: two digits, but no second decimal."""
    return f"{100.0 * value:.{0 if value >= 0.095 else 1}f}"


def thousands(count: float) -> str:
    """Return a count to a thousand, in groups of three digits."""
    return f"{round(count, -3):,.0f}".replace(",", " ")


def rows_of(benchmark: str, *words: str, ranks: int = 1) -> list[dict]:
    """Run a benchmark of this folder; return its rows, while it prints on the screen."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rows"
        script = f"benchmarks/{benchmark}.py"
        command = [*launcher, sys.executable, script, *words, "--json", str(file)]
        subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, check=True)
        return kept(str(file))


def whole() -> list[list[str]]:
    """Return where the time of a whole run goes [s]."""
    runs = rows_of("paper_scene")
    seconds = [
        [rounded(sum(run.get(one, 0.0) for one in parts)) for run in runs]
        for parts in PHASES.values()
    ]
    (first,) = (ceil(run["whole"]) for run in runs if run["run"] == "my_surface")
    readme = re.sub(r"After \d+ s it has", f"After {first} s it has", README.read_text("utf-8"))
    README.write_text(readme, encoding="utf-8")
    return [[name, *cells] for name, cells in zip(PHASES, seconds, strict=True)]


def bodies() -> list[list[str]]:
    """Return linear solutions of machine parts."""
    table = []
    for part, (name, cells, scale) in PARTS.items():
        (row,) = rows_of("body_solvers", part, "--scale", str(scale))
        seconds = f"{rounded(row['set_up'])} + {rounded(row['solution'])}"
        shown = thousands(row["unknowns"]), str(row["iterations"]), seconds
        table.append([name, cells, *shown, f"{row['bytes'] / 1e3:.1f}"])
    return table


def pads() -> list[list[str]]:
    """Return load steps of the brake pad under laws."""
    table, named = [], "quadratic tetrahedra, {} µm"
    with tempfile.TemporaryDirectory() as folder:
        for name, size, ranks, roughness in (
            ("small", [], 1, ["16", "4", "1"]),
            ("large", ["--size", "0.85"], 2, ["4"]),
        ):
            mesh = str(Path(folder) / f"{name}.msh")
            command = [sys.executable, "demos/bodies/brake_pad.py", "--out", mesh, *size]
            subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, check=True)
            words = ["--pad", mesh, "--roughness", *roughness]
            rubbed = iter(() if size else rows_of("laws_on_bodies", *words, "--friction", "0.3"))
            for row in rows_of("laws_on_bodies", *words, ranks=ranks):
                friction = next(rubbed, None)
                counts = str(row["newton"]), str(row["linear"])
                solutions = f"{row['flops']:.1f}", f"{row['cpu']:.1f}"
                more = "" if friction is None else f"{friction['friction']:.2f}"
                shown = thousands(row["unknowns"]), str(ranks)
                table.append([named.format(row["roughness"]), *shown, *counts, *solutions, more])
    return table


def large_pad() -> list[list[str]]:
    """Return the phases of a pad of a million unknowns, 8 load steps on two ranks."""
    (row,) = rows_of("body_solvers", "pad, 42:1", "--scale", "3.05", "--steps", "8", ranks=2)
    phases = row["seconds"]
    cells = [rounded(phases[name]) for name in phases] + [rounded(sum(phases.values()))]
    each = f"{max(row['newton'])}", f"{max(row['linear'])}", f"{row['bytes'] / 1e3:.1f}"
    return [[thousands(row["unknowns"]), *cells, *each]]


def peers(python: str) -> list[list[str]]:
    """Return cold solutions of periodic surfaces on one thread, beside peers."""
    words = ["--peers", python, "--sizes", "128", "256", "512", "--tolerances", "1e-8", "--curve"]
    table = []
    for row in rows_of("half_space_against_peers", *words):
        codes = row["codes"]
        own, *others = (codes[code] for code in ("patchlaw", "tamaas", "contactmechanics"))
        ratios = [f"{duration(peer)} ({times(peer, own)} ×)" for peer in others]
        memory = ", ".join(f"{code['megabytes']:.2g}" for code in (own, *others))
        table.append([f"{row['cells']}²", duration(own), *ratios, memory])
    return table


def duration(code: dict) -> str:
    """Return the time of a code, in milliseconds below a tenth of a second."""
    seconds = code["seconds"]
    return f"{1e3 * seconds:.0f} ms" if seconds < 0.0995 else f"{rounded(seconds)} s"


def times(peer: dict, own: dict) -> str:
    """Return how many times as long as patchlaw a peer takes."""
    ratio = peer["seconds"] / own["seconds"]
    return f"{ratio:.{0 if ratio >= 9.95 else 1}f}"


def peers_large(python: str) -> list[list[str]]:
    """Return larger surfaces on two threads; peers stop at 512², as they take minutes beyond."""
    words = ("--threads", "2", "--repeats", "1", "--large")
    rows = rows_of("half_space_against_peers", *words, "512", "--peers", python)
    rows += rows_of("half_space_against_peers", *words, "2048", "--codes", "patchlaw")
    return [large_row(row) for row in rows]


def large_row(row: dict) -> list[str]:
    """Return the row of a large surface."""
    codes, heights = row["codes"], row["cells"] ** 2
    own = codes["patchlaw"]

    def said(code: dict | None) -> str:
        if code is None:
            return "–"
        if "failed" in code:
            return "failed"
        ratio = times(code, own)
        each = code["megabytes"] * 2**20 / heights
        return f"{rounded(code['seconds'])} s, {each:.0f} B ({ratio} ×)"

    each = own["megabytes"] * 2**20 / heights
    alone = codes["patchlaw, 1 thread"]["seconds"]
    threads = f"{rounded(alone)} s", f"{rounded(own['seconds'])} s, {each:.0f} B"
    others = [said(codes.get(code)) for code in ("tamaas", "contactmechanics")]
    kind = f"{row['cells']}²", row["boundary"], f"{own['area']:.0%}".replace("%", " %")
    return [*kind, *threads, str(own["iterations"]), *others]


def laws() -> list[list[str]]:
    """Return what consistent laws take beside concurrent contacts, in processor time."""
    rows = [row for row in rows_of("law_rows") if "64²" not in row["case"]]
    first = rows[0]["seconds"]
    return [[row["case"], rounded(row["seconds"]), f"{row['seconds'] / first:.1f}"] for row in rows]


def couplings() -> list[list[str]]:
    """Return the times of laws and of load steps with them."""
    rows = {(row["patches"], row.get("most_rows")): row for row in rows_of("couplings")}
    once, each = ([rows[count, most]["seconds"] for count in (16, 256)] for most in (33, None))
    return [
        ["consistent laws on the block, 256² heights", *(f"{rounded(one)} s" for one in once)],
        ["100 load steps of the condensed block", *(f"{rounded(one)} s" for one in each)],
    ]


def slopes() -> list[list[str]]:
    """Return what a body and finite slopes cost in a load step."""
    rows = rows_of("contact_steps", "--grids", "64", "128", "256", "512")
    return [[f"{row['cells']}²", f"{row['body']:.1f}", f"{row['slopes']:.1f}"] for row in rows]


def shear() -> list[list[str]]:
    """Return what load steps in shear cost beside normal ones."""
    return [
        [
            "periodic" if row["periodic"] else "free",
            f"{row['poisson_ratio']:g}",
            f"{row['ratio']:.1f}",
        ]
        for row in rows_of("shear_steps")
    ]


TABLES: dict[str, tuple[list[str], Callable[..., list[list[str]]]]] = {
    "whole": (["phase", "paper, 1 rank", "paper, 2 ranks", "front page"], whole),
    "bodies": (
        ["part", "cells", "unknowns", "iterations", "set-up + solution [s]", "kB an unknown"],
        bodies,
    ),
    "large_pad": (
        [
            *("unknowns", "assembly [s]", "set-up", "law on the face", "8 load steps", "whole"),
            *("Newton steps", "linear iterations", "kB an unknown"),
        ],
        large_pad,
    ),
    "pads": (
        [
            *("pad, roughness", "unknowns", "ranks", "Newton steps", "linear iterations"),
            *("solutions by operations", "by CPU time", "friction"),
        ],
        pads,
    ),
    "peers": (
        ["cells", "patchlaw", "Tamaas 2.8.1", "ContactMechanics 1.7.0", "memory of each [MB]"],
        peers,
    ),
    "peers_large": (
        [
            *("cells", "boundary", "area", "patchlaw, 1 thread", "2 threads", "iterations"),
            *("Tamaas", "ContactMechanics"),
        ],
        peers_large,
    ),
    "laws": (["8 load steps, 128² heights", "CPU time [s]", "ratio"], laws),
    "couplings": (["", "16 patches", "256 patches"], couplings),
    "slopes": (["heights", "with the body", "with finite slopes, too"], slopes),
    "shear": (["boundary", "ν", "shear over normal"], shear),
}
"""Tables of ``docs/speed.md`` by the name in the comment above each: header, and what measures."""


def with_table(text: str, name: str, rows: list[list[str]]) -> str:
    """Return a page with the table below its comment in place of what was there.

    Args:
        text: The page.
        name: Of the table, in `TABLES`.
        rows: Its cells.
    """
    header, _ = TABLES[name]
    lines = [f"| {' | '.join(row)} |" for row in ([*header], ["---"] * len(header), *rows)]
    pattern = rf"(<!-- times: {name} -->\n\n)(?:\|.*\n)*\n?"
    text, count = re.subn(pattern, lambda found: found[1] + "\n".join(lines) + "\n\n", text)
    if count != 1:
        raise SystemExit(f"{SPEED} has no table {name!r}")
    return text


def with_rows(text: str) -> str:
    """Return the README with the times and errors of the stored comparison."""
    with COMPARED.open(encoding="utf-8", newline="") as file:
        found = {row["name"]: row for row in csv.DictReader(file)}
    for row, names in README_ROWS.items():
        seconds = ", ".join(rounded(float(found[name]["seconds"])) for name in names)
        errors = ", ".join(percent(float(found[name]["error_force_max"])) for name in names)
        pattern = rf"(\| {re.escape(row)} \| [^|]* \| )[^|]*? s( \| )[\d., ]+ %"
        text, count = re.subn(pattern, rf"\g<1>{seconds} s\g<2>{errors} %", text)
        if count != 1:
            raise SystemExit(f"README.md has no row {row!r}")
    return text


def compare_again() -> None:
    """Compare the paper's scene in every way on one core, and store the table."""
    with COMPARED.open(encoding="utf-8", newline="") as file:
        columns = next(csv.reader(file))
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "patchlaw", "compare", "demos/scenes/paper.toml"]
        subprocess.run([*words, "--out", folder], cwd=ROOT, env=ENVIRONMENT, check=True)
        with (Path(folder) / "compare.csv").open(encoding="utf-8", newline="") as file:
            found = list(csv.DictReader(file))
    with COMPARED.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)
    README.write_text(with_rows(README.read_text(encoding="utf-8")), encoding="utf-8")
    print("demos/compare.py --data demos/data draws the picture of the new table")


def machine() -> str:
    """Return a sentence on when and where the times were taken."""
    (model,) = set(re.findall(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text()))
    load, when = os.getloadavg()[0], datetime.now(UTC)
    return (
        f"Measured on {when:%Y-%m-%d} from {when:%H:%M} UTC on two cores of a virtual machine "
        f"({model}, {platform.system()}), load average {load:.1f} at the beginning."
    )


def main() -> None:
    """Measure, and write the pages; each table as soon as it is there."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--peers", metavar="PYTHON", help="interpreter that has the peers")
    parser.add_argument("--only", nargs="+", choices=["compare", *TABLES], metavar="TABLE")
    choice = parser.parse_args()
    names = choice.only or ["compare", *TABLES]
    if choice.only is None:
        text = SPEED.read_text(encoding="utf-8")
        text = re.sub(r"(?m)^Measured on .*$", lambda _: machine(), text, count=1)
        SPEED.write_text(text, encoding="utf-8")
    for name in names:
        if name == "compare":
            compare_again()
            continue
        _, measure = TABLES[name]
        if measure in (peers, peers_large):
            if choice.peers is None:
                continue
            measure = partial(measure, choice.peers)
        rows = measure()
        text = with_table(SPEED.read_text(encoding="utf-8"), name, rows)
        SPEED.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
