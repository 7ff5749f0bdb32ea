"""Time, memory and error of the periodic half-space beside Tamaas, ContactMechanics and aspher.

The peers live in an environment of their own, whose interpreter is given:

    python3 -m venv peers
    peers/bin/pip install ContactMechanics==1.7.0 SurfaceTopography==1.18.2 tamaas==2.8.1
    python benchmarks/half_space_against_peers.py --peers peers/bin/python

Their newest releases want a newer numpy than Debian's, and aspher Python 3.10 to 3.12; pip compiles
it by a C++17 compiler and CMake. It runs where it is named:

    python3.12 -m venv newest
    newest/bin/pip install ContactMechanics==1.8.3 tamaas==2.9.0 aspher==0.1.3.post1
    python benchmarks/half_space_against_peers.py --peers newest/bin/python \\
        --codes patchlaw tamaas contactmechanics aspher

Each code runs in a process of its own, on the same number of threads; times are medians of
interleaved repeats. The error is that of the pressures, relative in the L2 norm, against residual
1e-12. Large surfaces, periodic and not, at two contact areas, on two threads:

    python benchmarks/half_space_against_peers.py --peers peers/bin/python \\
        --large 2048 4096 --threads 2

Peers take many minutes for 4096 x 4096; ``--codes patchlaw`` leaves them out.
"""

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from json_rows import keep

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from patchlaw.geometry import Control, Spectrum, Surface, synthesise  # noqa: E402
from patchlaw.micro import HalfSpaceModel  # noqa: E402

CODES = ("patchlaw", "tamaas", "contactmechanics", "aspher")
BOUNDARIES = ("periodic", "free")
SLOPE, HURST = 0.1, 0.8
LOAD = 0.05 * SLOPE  # mean pressure over E*: 10 to 12 % of the area in contact
AREAS = {0.02: 0.0091 * SLOPE, 0.1: 0.047 * SLOPE}  # the pressures of about these shares of contact


class Process:
    """A code that solves on demand."""

    def __init__(self, python, code, threads=1):
        words = [python, str(Path(__file__).with_name("half_space_peers.py")), code]
        pipe = subprocess.PIPE
        environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
        self.process = subprocess.Popen(
            words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True, env=environment
        )

    def ask(self, **task):
        self.process.stdin.write(json.dumps(task) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def surface(n):
    """Draw a self-affine periodic surface, shortest wave eight cells."""
    spectrum = Spectrum(hurst=HURST, waves=(4, n // 8), rms_slope=SLOPE, seed=1)
    return synthesise(spectrum, grid=(n, n), lengths=(1.0, 1.0))


def reference(heights):
    """Solve far more strictly than any code that is timed."""
    periodic = Surface(heights=heights, lengths=(1.0, 1.0), periodic=True)
    model = HalfSpaceModel(surface=periodic, contact_modulus=1.0, periodic=True, tolerance=1e-12)
    return model.press(Control(force=LOAD)).pressure


def compare(pythons, task, repeats, exact):
    """Run all codes in turn, several times; return a row per code."""
    save = task["heights"] + ".pressure.npy"
    rows = {code: [] for code in pythons}
    fresh = {}
    for code, python in pythons.items():  # memory of a process that has done nothing else
        process = Process(python, code)
        fresh[code] = process.ask(**task, save=save)
        process.close()
        if exact is not None and "failed" not in fresh[code]:
            error = np.linalg.norm(np.load(save) - exact) / np.linalg.norm(exact)
            fresh[code]["error"] = float(error)
    processes = {code: Process(python, code) for code, python in pythons.items()}
    for _ in range(repeats):
        for code, process in processes.items():
            rows[code].append(process.ask(**task).get("seconds", np.nan))
    for process in processes.values():
        process.close()
    return {code: fresh[code] | {"seconds": statistics.median(rows[code])} for code in rows}


def large(pythons, sizes, boundaries, threads, repeats, json_file):
    """Solve large surfaces once per process; print a table per size, area and boundary."""
    own = CODES[0]
    with tempfile.TemporaryDirectory() as folder:
        for n in sizes:
            file = str(Path(folder) / f"{n}.npy")
            np.save(file, surface(n).heights)
            for kind, area in itertools.product(boundaries, AREAS):
                task = {"heights": file, "pressures": [AREAS[area]], "tolerance": 1e-6}
                task["periodic"] = kind == "periodic"
                runs = {f"{own}, 1 thread": []} if threads > 1 else {}
                runs |= {code: [] for code in pythons}
                for _ in range(repeats):
                    for name in runs:
                        code = name.partition(",")[0]
                        process = Process(pythons[code], code, 1 if "," in name else threads)
                        runs[name].append(process.ask(**task))
                        process.close()
                rows = {name: median(found) for name, found in runs.items()}
                show(f"{n} x {n}, {kind}, {area:.0%} contact, {threads} threads", rows, n * n)
                keep(json_file, cells=n, boundary=kind, area=area, codes=rows)


def median(answers):
    """Return the answer with the median time, or that of a failure."""
    failed = [answer for answer in answers if "failed" in answer]
    return (failed or sorted(answers, key=lambda one: one["seconds"]))[
        len(answers) // 2 * (not failed)
    ]


def show(title, rows, heights=None):
    """Print rows beside the first code's."""
    print(title)
    for code, row in rows.items():
        if "failed" in row:
            print(f"  {code:17s} failed: {row['failed']}")
            continue
        notes = [f"{row['seconds']:8.4f} s", f"{row['megabytes']:7.1f} MB"]
        if heights:
            notes.append(f"{row['megabytes'] * 2**20 / heights:4.0f} bytes a height")
            notes.append(f"contact {row['area']:.3f}")
        if "error" in row:
            notes.append(f"error {row['error']:.0e}")
        if row["iterations"]:
            notes.append(f"{row['iterations']} iterations")
        notes.append(f"{row['seconds'] / rows[CODES[0]].get('seconds', np.nan):.2f} x")
        print(f"  {code:17s} " + "  ".join(notes), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", help="interpreter that has the peers")
    parser.add_argument("--sizes", type=int, nargs="+", default=[128, 256, 512, 1024])
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-4, 1e-8])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--curve", type=int, nargs="*", default=[128, 256], help="sizes")
    parser.add_argument("--large", type=int, nargs="+", help="sizes for a table of their own")
    parser.add_argument("--threads", type=int, default=1, help="of each code, in that table")
    parser.add_argument("--codes", nargs="+", choices=CODES, default=CODES[:3], help="which to run")
    parser.add_argument(
        "--boundaries", nargs="+", choices=BOUNDARIES, default=BOUNDARIES, help="in that table"
    )
    parser.add_argument("--json", metavar="FILE", help="append the rows to it")
    options = parser.parse_args()
    if options.peers is None and options.codes != ["patchlaw"]:
        parser.error("--peers names the interpreter of the peers; without one: --codes patchlaw")
    pythons = {code: options.peers for code in options.codes}
    pythons["patchlaw"] = sys.executable  # to whose times all others are related
    if options.large:
        given = options.large, options.boundaries, options.threads, options.repeats
        large(pythons, *given, options.json)
        return
    with tempfile.TemporaryDirectory() as folder:
        for n in options.sizes:
            file = str(Path(folder) / f"{n}.npy")
            heights = surface(n).heights
            np.save(file, heights)
            exact = reference(heights)
            for tolerance in options.tolerances:
                task = {"heights": file, "pressures": [LOAD], "tolerance": tolerance}
                repeats = options.repeats if n <= 512 else max(1, options.repeats // 2)
                rows = compare(pythons, task, repeats, exact)
                show(f"cold {n} x {n}, tolerance {tolerance:g}", rows)
                keep(options.json, cells=n, tolerance=tolerance, codes=rows)
        for n in options.curve:
            file = str(Path(folder) / f"{n}.npy")
            np.save(file, surface(n).heights)
            pressures = (LOAD * np.arange(1, 31) / 30).tolist()
            task = {"heights": file, "pressures": pressures, "tolerance": 1e-6}
            show(f"curve of 30 forces, {n} x {n}, tolerance 1e-6", compare(pythons, task, 3, None))


if __name__ == "__main__":
    main()
