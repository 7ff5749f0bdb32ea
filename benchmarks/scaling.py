"""Scaling of the block's solve: times on 1 and 2 ranks, counts on more, and what they mean.

Run by hand on an idle machine: ``.venv/bin/python benchmarks/scaling.py [PART …] [--quick]
[--large]``. Parts: bandwidth, strong, weak, counts, iterations, model; all of them unless some are
named. Strong scaling on 10⁶ unknowns, weak scaling on 5·10⁵ per rank, uniform and graded, told
beside what two cores get of the memory. Then messages, bytes and reductions on 1 to 8 ranks, grid
by grid, and iterations on 10⁴ to 10⁶ unknowns, which do not depend on the machine even where ranks
share cores. ``--large`` adds 5·10⁶ unknowns and 27 ranks; it wants 13 GB. ``--ranks N`` starts
what is told of sizes alone, the iterations, on N ranks. ``--facts FILE`` keeps what was measured
for other runs, which measure the rest only.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import scaling_tables as tables
from helpers.mpi_environment import MPI_ENVIRONMENT
from scaling_model import Machine, observed

HERE = Path(__file__).parent
ENVIRONMENT = os.environ | MPI_ENVIRONMENT | {"PYTHONPATH": str(HERE.parent)}
Sizes = dict[str, object]


def start(ranks: int, script: str, *words: str) -> dict:
    """Start a script of this folder on a number of ranks and return what it prints as JSON."""
    done = subprocess.run(
        ["mpirun", "-n", str(ranks), sys.executable, str(HERE / script), *words],
        env=ENVIRONMENT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


class Facts:
    """Facts of blocks, each measured once.

    Args:
        file: Where they are kept from run to run; None: nowhere.
    """

    def __init__(self, file: Path | None) -> None:
        self._file, self._known = file, {}
        if file and file.exists():
            self._known = json.loads(file.read_text(encoding="utf-8"))

    def __call__(self, ranks: int, sizes: Sizes) -> dict:
        """Return those of one block on a number of ranks."""
        name = json.dumps([ranks, sizes])
        if name not in self._known:
            self._known[name] = start(ranks, "scaling_rank.py", json.dumps(sizes))
            if self._file:
                self._file.write_text(json.dumps(self._known), encoding="utf-8")
        return self._known[name]


def block(
    unknowns: float,
    *,
    cells: tuple[float, float, float] = (1, 1, 1),
    lengths: tuple[float, float, float] = (1, 1, 1),
    grading: float = 1.0,
) -> Sizes:
    """Return a block of some proportions with about so many unknowns.

    Args:
        unknowns: Three for each node.
        cells: Numbers of cells along x, y and z relative to each other.
        lengths: Sides [mm].
        grading: Height of the lowest layer relative to the top one.
    """
    share = (unknowns / 3.0 / (cells[0] * cells[1] * cells[2])) ** (1.0 / 3.0)
    nx, ny, nz = (max(2, round(share * part) - 1) for part in cells)
    x, y, z = lengths
    return {"interface": [x, y], "height": z, "cells": [nx, ny, nz], "grading": grading}


SHAPES: dict[str, Callable[[float], Sizes]] = {
    "uniform cube": lambda n: block(n),
    "graded 10": lambda n: block(n, cells=(2, 2, 1), grading=10.0),
    "graded 20": lambda n: block(n, cells=(2, 2, 1), grading=20.0),
    "tall cells 8:1": lambda n: block(n, cells=(2, 2, 1), lengths=(1, 1, 4)),
    "flat cells 8:1": lambda n: block(n, lengths=(1, 1, 0.125)),
    "slab 16:16:1": lambda n: block(n, cells=(16, 16, 1), lengths=(16, 16, 1)),
    "column 1:1:16": lambda n: block(n, cells=(1, 1, 16), lengths=(1, 1, 16)),
}
PARALLEL = ("uniform cube", "graded 20")


def weak(name: str, unknowns: float, ranks: int) -> Sizes:
    """Return a block with the cells of one rank's once for each rank, side by side."""
    sizes = SHAPES[name](unknowns)
    (x, y), (nx, ny, nz) = sizes["interface"], sizes["cells"]
    return sizes | {"interface": [ranks * x, y], "cells": [ranks * nx, ny, nz]}


class Benchmark:
    """The parts, each of which measures and prints.

    Args:
        scale: Share of the unknowns.
        large: Whether blocks of 5·10⁶ unknowns and 27 ranks are measured too.
        ranks: Ranks of what does not depend on them.
        on: Facts of a block on a number of ranks.
    """

    def __init__(self, scale: float, large: bool, ranks: int, on: Facts) -> None:
        self.scale, self.is_large, self.ranks, self.on = scale, large, ranks, on

    @cached_property
    def rates(self) -> dict[int, dict[str, float]]:
        """Bandwidths on 1 and 2 ranks; never kept in a file, for they belong to the moment."""
        return {ranks: start(ranks, "stream_triad.py", "--json") for ranks in (1, 2)}

    def bandwidth(self) -> None:
        """What one core gets of the memory, and two at once."""
        tables.show_bandwidth(self.rates)

    def strong(self) -> None:
        """One block on 1 and 2 ranks."""
        for unknowns in (1e6, 5e6) if self.is_large else (1e6,):
            for name in PARALLEL:
                facts = [self.on(ranks, SHAPES[name](self.scale * unknowns)) for ranks in (1, 2)]
                tables.show_times(f"strong scaling, {name}", facts, self.rates, weak=False)

    def weak(self) -> None:
        """As many unknowns for each rank, on 1 and 2."""
        for unknowns in (5e5, 2.5e6) if self.is_large else (5e5,):
            for name in PARALLEL:
                facts = [
                    self.on(ranks, weak(name, self.scale * unknowns, ranks)) for ranks in (1, 2)
                ]
                tables.show_times(f"weak scaling, {name}", facts, self.rates, weak=True)

    def counted(self) -> list[dict]:
        """Return the facts of the block whose messages are counted."""
        numbers = (1, 2, 4, 8, 27) if self.is_large else (1, 2, 4, 8)
        return [self.on(ranks, SHAPES["uniform cube"](self.scale * 2e5)) for ranks in numbers]

    def graded(self) -> list[dict]:
        """Return the facts of a graded block on 2 and 8 ranks."""
        return [self.on(ranks, SHAPES["graded 20"](self.scale * 2e5)) for ranks in (2, 8)]

    def counts(self) -> None:
        """What an iteration sends, grid by grid."""
        tables.show_counts("uniform cube", self.counted())
        tables.show_levels("uniform cube", self.counted())
        tables.show_levels("graded 20", self.graded())

    def iterations(self) -> None:
        """Iterations over sizes and shapes."""
        sizes = [self.scale * n for n in (1e4, 1e5, 1e6, 5e6)[: 4 if self.is_large else 3]]
        tables.show_iterations(
            (name, [self.on(self.ranks, shape(n)) for n in sizes]) for name, shape in SHAPES.items()
        )

    def model(self) -> None:
        """What the counts mean for many ranks, and how well they follow the model on few."""
        facts = {fact["ranks"]: fact for fact in self.counted()}
        seen = observed(facts[2], facts[8])
        smaller = self.on(8, SHAPES["uniform cube"](self.scale * 2e5 / 8))
        tables.show_check(seen, list(facts.values()), smaller)
        tables.show_model("uniform cube", seen, Machine())
        tables.show_model("graded 20", observed(*self.graded()), Machine())


def main() -> None:
    """Measure and print what is asked for."""
    parts = ("bandwidth", "strong", "weak", "counts", "iterations", "model")
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(parts))
    parser.add_argument("--quick", action="store_true", help="a hundredth of the unknowns")
    parser.add_argument("--large", action="store_true", help="5·10⁶ unknowns and 27 ranks as well")
    parser.add_argument("--ranks", type=int, default=1, help="ranks of the iterations' part")
    parser.add_argument("--facts", type=Path, help="JSON file that measured facts are kept in")
    choice = parser.parse_args()
    if unknown := set(choice.parts) - set(parts):
        parser.error(f"unknown part {', '.join(unknown)}; there are {', '.join(parts)}")
    benchmark = Benchmark(
        0.01 if choice.quick else 1.0, choice.large, choice.ranks, Facts(choice.facts)
    )
    for part in choice.parts or parts:
        getattr(benchmark, part)()
        sys.stdout.flush()


if __name__ == "__main__":
    main()
