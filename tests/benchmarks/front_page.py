"""Measures the times of the README anew, and writes them into it; run it on an idle machine.

    .venv/bin/python tests/benchmarks/front_page.py        # the first command alone, half a minute
    .venv/bin/python tests/benchmarks/front_page.py --all  # and the paper's scene, six minutes

The first command is run three times, as a user runs it; the least wall time counts. The paper's
scene is compared in every way on one core, and the table goes to ``demos/data``. The README's other
times are those of ``docs/speed.md``, which has their commands.
"""

import argparse
import csv
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from math import ceil
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
TABLE = ROOT / "demos" / "data" / "compare_paper.csv"
SCENE = "demos/scenes/my_surface.toml"

ROWS = {
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


def rounded(value: float) -> str:
    """Return a time as tables show it: no decimals from ten on, one from one on, else two."""
    return f"{value:.{0 if value >= 10.0 else 1 if value >= 1.0 else 2}f}"


def percent(value: float) -> str:
    """Return an error as tables show it, in per cent: two digits, but no second decimal."""
    return f"{100.0 * value:.{0 if value >= 0.095 else 1}f}"


def cells() -> dict[str, tuple[str, str]]:
    """Return time and error that the README states of every row, from the stored comparison."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        found = {row["name"]: row for row in csv.DictReader(file)}
    return {
        row: (
            ", ".join(rounded(float(found[name]["seconds"])) for name in names) + " s",
            ", ".join(percent(float(found[name]["error_force_max"])) for name in names) + " %",
        )
        for row, names in ROWS.items()
    }


def with_rows(text: str) -> str:
    """Return the README with the times and errors of the stored comparison."""
    for row, (seconds, error) in cells().items():
        pattern = rf"(\| {re.escape(row)} \| [^|]* \| )[^|]*? s( \| )[\d., ]+ %"
        text, count = re.subn(pattern, rf"\g<1>{seconds}\g<2>{error}", text)
        if count != 1:
            raise SystemExit(f"README.md has no row {row!r}")
    return text


def first_command(repeats: int = 3) -> float:
    """Return the least wall time of the README's first command, and print all [s]."""
    words, times = [sys.executable, "-m", "patchlaw", "run", SCENE], []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            used, began = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
            subprocess.run([*words, "--out", folder], cwd=ROOT, check=True, capture_output=True)
            times.append(time.perf_counter() - began)
            used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - used
        print(f"first command: {times[-1]:.1f} s wall, {used:.1f} s of user CPU", flush=True)
    return min(times)


def compare_again() -> None:
    """Compare the paper's scene in every way on one core, and store the table."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        columns = next(csv.reader(file))
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "patchlaw", "compare", "demos/scenes/paper.toml"]
        one = os.environ | {"OMP_NUM_THREADS": "1"}
        subprocess.run([*words, "--out", folder], cwd=ROOT, env=one, check=True)
        with (Path(folder) / "compare.csv").open(encoding="utf-8", newline="") as file:
            found = list(csv.DictReader(file))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)


def main() -> None:
    """Measure, and write the README."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--all", action="store_true", help="the paper's scene, too")
    text, whole = README.read_text(encoding="utf-8"), parser.parse_args().all
    text = re.sub(r"After \d+ s it has", f"After {ceil(first_command())} s it has", text)
    if whole:
        compare_again()
        text = with_rows(text)
        print("demos/compare.py --data demos/data draws the picture of the new table")
    README.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
