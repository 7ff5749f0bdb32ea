"""Compares random scenes with twins that must agree, in all columns of tables; see ``--help``.

Twins are the scene in other units of length, modulus, time and conductivity; mirrored, with x and y
exchanged, shifted over periodic borders, raised, counted from another zero; gone on from a
checkpoint, in finer load steps, on two ranks, by another coupling, as a dolfinx program of its own.
A neighbouring load step tells stiffnesses and energies. Scenes are those of
``benchmarks/twin_scenes.py``.
"""

import argparse
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1]))

from helpers.mpi_environment import BESIDE_OTHERS
from helpers.resumed_runs import gone_on, ran_past

from benchmarks.own_program import differences_of_program
from benchmarks.twin_moves import SYMMETRIES
from benchmarks.twin_scenes import FEATURES, KINDS, DrawnScene, ran, scene_of
from benchmarks.twin_tables import compared, tables
from patchlaw import InputError, NotConverged
from patchlaw.multiscale.loading.load_step import COLUMNS, LOOSE

LIMITS = {
    "finer": 1e-5,  # paths of elastic contacts do not matter; residuals are 1e-8
    "resumed": 1e-7,
    "program": 1e-7,  # residuals of 1e-8
    "ranks": 1e-6,  # 1e-8 of forces; less of stiffnesses and gaps near none
    # curvature over a ten-thousandth of the load, 1e-8 of residuals over it; with finite slopes
    # the share of the second order changes with pressures, and ½ ∫ p u is no potential: 6e-4
    "derivative": 2e-3,
    "concurrent": 2e-2,  # interpolation of laws: 2e-3 of the force, more of its derivative
    "alone": 1e-8,  # of forces; sums are exact
    # gaps and pressures of a law are interpolated each on its own, in tables to 2e-2
    "derivative of laws": 5e-2,
}
"""Largest differences by twin where they are not those of a symmetry."""
OF_SYMMETRIES = 1e-5
"""Of columns under a symmetry: residuals of 1e-8 over what gaps and stiffnesses cancel."""
OF_ERRORS = 100.0
"""The same of columns of errors, which are differences of solutions, over that of others."""
OF_QUADRATURE = 1e-3
"""Of laws at points of facets, which are cut into triangles along one diagonal: mirrored they are
cut along the other one. What slips is counted by points."""
OF_READ_OFF = 1e-2
"""Of areas and stiffnesses there: of pressures that are the same they differ by their slopes from
row to row of a law. The area of a zone of four facets differed by 5.4e-3, of facets cut into four,
nine and sixteen by 4.3e-4, 1.8e-4 and 1.7e-4; its force by 1.7e-5."""
OF_TURNED_ERRORS = 5e-2
"""Of errors there, which are differences of what is read off: of the first frequency's 2.3e-2."""
OF_CONTACTS = 0.2
"""Of numbers of contacts there, of which one just touches: 4 and 5, of 6 at other load steps."""
OF_PROPORTION = 0.2
"""Of errors by elements, told once for forces within a factor of 16: in finer load steps at
another force."""
OF_CELLS = 0.1
"""Of areas of laws: between rows they grow evenly, on cells by whole ones, of which 20 touch."""
TURNED = ("symmetries", "mirrored", "flipped", "transposed")
FURTHER = 1e-4
TRACES = ("hardness", "friction", "wear", "stage", "temperature", "tractions")
BEYOND = ("counter_body", "crown", "regions", "temperature", "zero")
"""What a program has not, which is otherwise compared with scenes of a law on a body."""
BY_LAWS = ("approach_mm", "force_N", "contact_area_fraction", "mean_separation_mm")
BY_ROWS = ("consistent", "points", "representative")
"""Kinds whose laws are tables; those of patches alone are so too, but fine ones."""


class Slow(Exception):
    """A scene took longer than it may."""


def limit(twin, column, kind=""):
    """Return what a column of a twin may differ by."""
    if kind in ("points", "representative") and twin in TURNED:
        if "slip" in column or "error" in column:
            return OF_TURNED_ERRORS if "error" in column else 2e-2
        if column == "contacts":
            return OF_CONTACTS
        return OF_READ_OFF if "area" in column or "stiffness" in column else OF_QUADRATURE
    if kind == "representative" and twin == "finer" and "error" in column:
        return OF_PROPORTION
    if twin == "concurrent" and "area" in column:
        return OF_CELLS
    return LIMITS.get(twin, OF_SYMMETRIES) * (OF_ERRORS if "error" in column else 1.0)


def all_at_once(data, random):
    """Return the scene under all symmetries, one after another, and the way back."""
    backs = []
    for twin in SYMMETRIES.values():
        if (made := twin(data, random)) is not None:
            data, back = made
            backs.insert(0, back)

    def back(table):
        for one in backs:
            table = one(table)
        return table

    return data, back


def tried(case, folder, ranks):
    """Yield differences of a scene from its twins: twin, column, how much, and between what."""
    random, data = np.random.default_rng((case.seed, 1)), case.data
    path = folder / "checkpoint.h5"
    path.unlink(missing_ok=True)
    whole = ran_past(scene_of(data), int(random.integers(1, 4)), path)
    history = whole.history()
    whole.close()
    if any(LOOSE in step.warnings for step in history) or not history.force_N.any():
        return
    base = tables(history)
    for name, wrong in alone(case, history):
        yield "alone", name, wrong, ""
    seed = int(random.integers(1 << 30))
    found = [("symmetries", *one) for one in differences(base, all_at_once, data, seed)]
    if not all(one[2] <= limit(*one[:2]) for one in found):  # which of them?
        for name, twin in SYMMETRIES.items():
            found += [(name, *one) for one in differences(base, twin, data, seed)]
    yield from found
    for name, twin in (("derivative", derivatives), ("finer", finer), ("concurrent", concurrent)):
        name += " of laws" * (name == "derivative" and case.kind in BY_ROWS)
        for one in twin(data, history):
            yield name, *one
    if case.samples and "body" in data and not any(f"'{one}'" in str(data) for one in BEYOND):
        yield from (("program", *one) for one in differences_of_program(data))
    if path.exists() and len(history) > 1:
        again, _ = gone_on(scene_of(data), path)
        yield from (("resumed", *one) for one in compared(base, tables(again.history())))
        again.close()
    if ranks > 1:
        yield from (("ranks", *one) for one in compared(base, on_ranks(data, ranks)))


def differences(base, twin, data, seed):
    """Yield the columns of a twin, the differences, and what they are."""
    if (made := twin(data, np.random.default_rng(seed))) is None:
        return
    try:
        found = made[1](tables(ran(made[0])))
    except (InputError, NotConverged) as error:
        yield "ended", np.inf, str(error)
        return
    yield from compared(base, found)


def on_ranks(data, ranks):
    """Return the tables of a scene on several ranks."""
    Path("ranks.pickle").write_bytes(pickle.dumps(data))
    words = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, __file__, "--one"]
    done = subprocess.run(
        [*words, "ranks.pickle"], capture_output=True, text=True, check=False,
        env=os.environ | BESIDE_OTHERS,  # without what MPI has set in this process
    )  # fmt: skip
    if done.returncode:
        return {done.stderr[-300:]: ("", np.zeros(0))}
    return pickle.loads(Path("ranks.pickle").read_bytes())


def one_of_ranks(path):
    """Run a scene on the ranks of this job, and put its tables in its place."""
    from mpi4py import MPI

    data = pickle.loads(Path(path).read_bytes())
    MPI.COMM_WORLD.Barrier()
    found = tables(ran(data, MPI.COMM_WORLD))
    if MPI.COMM_WORLD.rank == 0:
        Path(path).write_bytes(pickle.dumps(found))


def load_of(data):
    """Return the key of the only load of an elastic scene, and the load; None of others."""
    if any(f"'{word}'" in str(data) for word in TRACES):
        return None
    key = next(key for key in ("approach", "force", "pressure") if key in data["load"])
    return None if len(data["load"][key]) > 1 else (key, data["load"][key][0])


def derivatives(data, history):
    """Yield stiffnesses and energies against the difference from a load a little further."""
    if (load := load_of(data)) is None or not history.force_N[-1] > 0.0:
        return
    key, most = load
    load = data["load"] | {key: [most, (1.0 + FURTHER) * most], "steps": 1}
    found = ran(data | {"load": load, "output": data["output"] | {"check": "none"}})
    force, approach, gap = (
        float(np.diff(one)[-1])
        for one in (found.force_N, found.approach_mm, found.mean_separation_mm)
    )
    pairs = {
        "approach_stiffness_N_per_mm": force / approach,
        "interface_stiffness_N_per_mm": -force / gap,
        "elastic_energy_mJ": approach * float(found.force_N.mean()),
    }
    if "law" in data:  # the integral of −dp/dū: gaps of a face change by different amounts
        del pairs["interface_stiffness_N_per_mm"]
    for name, value in pairs.items():
        column = getattr(found, name)
        stated = float(np.diff(column)[-1] if "energy" in name else column.mean())
        if stated:
            yield name, abs(value / stated - 1.0) if stated == stated else 0.0, f"{value}, {column}"


def finer(data, history):
    """Yield what twice as many load steps change of an elastic scene."""
    if load_of(data) is None:
        return
    steps = data["load"]["steps"]
    found = ran(data | {"load": data["load"] | {"steps": 2 * steps}})
    # work is a trapezoidal rule; contacts are numbered by their load steps
    begins = ("work_mJ", "step", "map", "spots")
    own = {n: one for n, one in tables(history).items() if not n.startswith(begins)}
    last = {n: (unit, v[-1:]) for n, (unit, v) in tables(found).items() if n in own}
    yield from compared({n: (unit, v[-1:]) for n, (unit, v) in own.items()}, last)


def concurrent(data, history):
    """Yield what laws of patches change against the cells that they are made from."""
    coupling = data.get("coupling", {})
    words = ("hardness", "friction", "wear", "vibration", "temperature", "model")
    if coupling.get("kind") != "consistent" or "interface" in coupling:
        return
    if any(f"'{word}'" in str(data) for word in words):
        return
    found = tables(ran(data | {"coupling": {"kind": "concurrent"}}))
    own = tables(history)
    names = [one for one in BY_LAWS if one in found]
    yield from compared({n: own[n] for n in names}, {n: found[n] for n in names})


def alone(case, history):
    """Yield what must hold of one history, and how far it does not."""
    force, pressed = history.force_N, history.force_N != 0.0
    most, area = force.max() or 1.0, history.contact_area_fraction
    for name in ("contact_area_fraction", "yielding_area_fraction", "slip_area_fraction"):
        values = np.nan_to_num(getattr(history, name))
        yield name, max(0.0, (values - area - 1e-12).max(), -values.min())
    sums = {"mean_pressure_MPa": history.mean_pressure_MPa}
    if not case.samples:  # whose regions are of any size
        sums["patch_pressure_MPa"] = history.patch_pressure_MPa.mean(axis=1)
    for name, mean in sums.items():
        apart = np.abs(mean * case.area - force)[pressed] / np.abs(force[pressed])
        yield name, float(apart.max())
    for name in ("plastic_work_mJ", "dissipated_mJ", "worn_volume_mm3"):
        values = np.nan_to_num(getattr(history, name))
        yield f"{name} grows", float((-np.diff(values)).max(initial=0.0) / (values.max() or 1.0))
    energy = np.nan_to_num(history.elastic_energy_mJ)
    yield "elastic_energy_mJ", max(0.0, -energy.min()) / (energy.max() or 1.0)
    micro = case.data.get("micro", {})
    if (hardness := micro.get("hardness")) is not None:
        yield "peak_pressure_MPa", max(0.0, np.nanmax(history.peak_pressure_MPa) / hardness - 1.0)
        bears = max(0.0, (force / (hardness * case.area) - area).max())
        yield "area bears the force", float(bears)
    if "shear" in str(case.data["load"]):
        shear = np.hypot(history.shear_force_x_N, history.shear_force_y_N)
        bound = case.data["friction"]["coefficient"] * force
        yield "friction bounds the shear force", max(0.0, np.nanmax(shear - bound)) / most
    yield from again(case, history)
    if load_of(case.data) and case.data["load"].get("tilt") != "free":
        for name in ("leak_x_mm3_per_s", "leak_y_mm3_per_s", "leak_mm3_per_s"):
            values = getattr(history, name, None)
            if values is not None and np.isfinite(values).all() and values.any():
                yield f"{name} rises", float(max(0.0, *(np.diff(values) / values.max()), 0.0))
    for step in history:
        measured, slides = step.force_error_N is not None, "sliding" in str(case.data["load"])
        # cells too few to halve, of which a note tells
        unknown = not np.isfinite([error for _, error in step.shear_errors]).all()
        for one in (one for one in COLUMNS if one.error):
            if slides and one.name == "dissipated_mJ":  # μ times force and distance
                continue
            error = one.error_of(step)
            if error is not None and not error >= 0.0:
                yield f"{one.name}: its error is negative", 1.0
            told = "leak" in one.name and "'hardness'" in str(case.data)  # after unloading: a note
            told = told and step.force_N < force[: step.step].max()
            # what slips of points under laws has no error
            told |= one.name == "slip_area_fraction" and case.kind in ("points", "representative")
            # a contact that may not be there leaves what it does without a bound
            told |= unknown or (measured and step.force_error_N > step.force_N)
            if measured and one.of(step) is not None and error is None and not told:
                yield f"{one.name}: its error is missing", 1.0


def again(case, history):
    """Yield what the same load changes where it comes again, which nothing but yielding did."""
    if any(f"'{word}'" in str(case.data) for word in ("friction", "wear", "stage")):
        return
    key = next(key for key in ("approach", "force", "pressure") if key in case.data["load"])
    first, other = history.force_N, history.approach_mm
    values, answers = (other, first) if key == "approach" else (first, other)
    for one in range(1, len(values)):
        if (back := np.isclose(values[:one], values[one], rtol=1e-12)).any():
            if values[one] < values[:one].max() * (1.0 - 1e-9) and "hardness" in str(case.data):
                continue  # first on the way there, then on the way back
            apart = np.abs(answers[:one][back] - answers[one]).max()
            yield "the same load again", float(apart / (np.abs(answers).max() or 1.0))


def campaign(choice, folder):
    """Run the scenes; print differences; return by twin and column the largest, and the scenes."""
    worst, ends, seen = defaultdict(float), defaultdict(int), defaultdict(set)

    def late(*_):
        raise Slow

    signal.signal(signal.SIGPROF, late)
    for seed in range(choice.seed, choice.seed + choice.scenes):
        began, end = time.process_time(), "nothing presses"
        signal.setitimer(signal.ITIMER_PROF, choice.longest)
        try:
            case = DrawnScene(seed, choice.only, choice.kind)
            print(f"scene {seed}: {case}", flush=True)
            for twin, name, apart, told in tried(case, folder, choice.ranks):
                worst[twin, name], end = max(worst[twin, name], apart), "compared"
                seen[twin].add(seed)
                if not apart <= limit(twin, name, case.kind):
                    print(f"   {twin}: {name} {apart:.1e}: {told}", flush=True)
                    ends["differs"] += 1
        except (InputError, NotConverged) as error:
            end = f"ended: {error}"[:200]
        except Slow:
            end = "slow"
        except Exception:
            end = f"DEFECT: {traceback.format_exc()[-1500:]}"
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        ends[end.split(":")[0]] += 1
        print(f"   {end}, {time.process_time() - began:.1f} s", flush=True)
    return worst, ends, seen


def main():
    """Run the campaign, and print the largest differences by twin."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first scene")
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument("--only", nargs="*", default=(), choices=FEATURES, help="features to cross")
    parser.add_argument("--ranks", type=int, default=1, help="beside one")
    parser.add_argument("--longest", type=float, default=100.0, help="seconds of CPU for a scene")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    choice = parser.parse_args()
    if choice.one:
        one_of_ranks(choice.one)
        return
    warnings.simplefilter("ignore", RuntimeWarning)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PATCHLAW_CACHE"] = folder  # twins that are the same body solve it once
        os.chdir(folder)
        worst, ends, seen = campaign(choice, Path(folder))
        os.chdir("/")
    print(dict(ends))
    for twin in sorted({twin for twin, _ in worst}):
        own = {name: apart for (one, name), apart in worst.items() if one == twin}
        shares = {name: apart / limit(twin, name) for name, apart in own.items()}
        largest = sorted(shares, key=shares.get)[-3:]
        told = ", ".join(f"{name} {own[name]:.1e}" for name in reversed(largest))
        count = f"{len(seen[twin])} scenes, {len(shares)} columns"
        print(f"{twin}: {count}; nearest to their limits {told}")
    sys.exit(1 if ends["differs"] or ends["DEFECT"] else 0)


if __name__ == "__main__":
    main()
