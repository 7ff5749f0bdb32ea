"""Tries thousands of generated inputs in every door of the program; see ``--help``."""

import argparse
import contextlib
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from helpers import mesh_files, wrong_arguments  # noqa: E402

from benchmarks import (  # noqa: E402
    command_words,
    compared_inputs,
    height_files,
    map_round_trips,
    misspellings,
    mutated_scenes,
    result_folders,
    scene_inputs,
    shell_lines,
    stored_inputs,
)
from patchlaw.geometry.meshes.gmsh_file import read_gmsh_file  # noqa: E402

LONGEST = 30  # seconds of the processor for one input
LONGEST_WAIT = 120  # seconds on the clock, for one that waits; the machine may be busy
MOST_MEMORY = 6 << 30  # bytes of address space


class Hang(Exception):
    """An input took longer than `LONGEST`, or than `LONGEST_WAIT`."""


def doors(folder):
    """Yield the name of each kind of input, its strategy, what tries one, and its share."""
    scene, set_ = folder / "scene.toml", scene_inputs.toml(scene_inputs.BASE).encode()
    laws, checkpoint = stored_inputs.originals(scene_inputs.BASE, folder)

    def write(path, content):
        path.write_bytes(content)
        return path

    def text(data):
        return scene_inputs.toml(data).encode("utf-8", "surrogatepass")

    words = st.builds(
        "{}={}".format, st.sampled_from(sorted(scene_inputs.KEYS)), scene_inputs.odd_text
    )
    yield (
        "scenes, planned",
        scene_inputs.scenes(),
        lambda data: scene_inputs.planned(write(scene, text(data))),
        0.2,
    )
    yield (
        "scenes, run",
        scene_inputs.scenes(),
        lambda data: scene_inputs.ran(write(scene, text(data))),
        0.05,
    )
    yield (
        "scene files damaged",
        scene_inputs.damaged(),
        lambda content: scene_inputs.planned(write(scene, content)),
        0.1,
    )
    yield (
        "stored scenes mutated",
        mutated_scenes.mutated,
        lambda text: scene_inputs.planned(write(scene, text.encode("utf-8", "surrogatepass"))),
        0.15,
    )
    yield (
        "surfaces of any kind, run",
        mutated_scenes.surfaces(),
        lambda drawn: on_heights(folder, *drawn),
        0.08,
    )
    yield (
        "shells",
        shell_lines.lines,
        lambda line: shell_lines.called(write(scene, set_), line),
        0.02,
    )
    yield (
        "words of --set",
        st.one_of(words, scene_inputs.odd_text),
        lambda word: scene_inputs.planned(write(scene, set_), [word]),
        0.1,
    )
    yield (
        "files of heights",
        st.tuples(height_files.anything, height_files.sides),
        lambda drawn: height_files.read(write(folder / f"h{drawn[0][0]}", drawn[0][1]), drawn[1]),
        0.15,
    )
    seeds = st.integers(0, 2**32 - 1)
    yield (
        "maps with masks and units, read back",
        seeds,
        lambda drawn: map_round_trips.came_back(folder, drawn),
        0.1,
    )
    yield (
        "texts with a damaged cell",
        seeds,
        lambda drawn: map_round_trips.damage_was_told(folder, drawn),
        0.1,
    )
    yield ("keys misspelt", misspellings.keys(), misspellings.key_was_offered, 0.05)
    yield ("units of the wrong case", misspellings.units(), misspellings.unit_was_offered, 0.05)
    yield (
        "comparisons",
        compared_inputs.asked,
        lambda drawn: compared_inputs.compared(write(scene, text(drawn[0])), *drawn[1:]),
        0.05,
    )
    yield (
        "command lines",
        command_words.lines,
        lambda words: command_words.called(write(scene, set_), words),
        0.05,
    )
    damages = {
        "law files": st.one_of(stored_inputs.flipped(laws), stored_inputs.rewritten(laws)),
        "checkpoints": stored_inputs.flipped(checkpoint),
    }
    for (name, damage), reader in zip(damages.items(), stored_inputs.READERS, strict=True):
        yield (
            name,
            damage,
            lambda content, reader=reader: stored_inputs.read(
                write(folder / "stored.h5", content), reader
            ),
            0.05,
        )

    yield "arguments of public names", wrong_arguments.mistakes, wrong_arguments.called, 0.3
    for name, strategy, attempt, share in (
        ("names of any bytes", result_folders.bytes_of_names, result_folders.named, 0.02),
        ("tables cut short", result_folders.cuts, result_folders.cut, 0.05),
        ("foreign files of results", result_folders.foreign, result_folders.beside_foreign, 0.02),
        ("options in working folders", result_folders.settings, result_folders.configured, 0.005),
    ):
        yield name, strategy, lambda drawn, attempt=attempt: attempt(folder, drawn), share
    yield "tilts under missing heights", seeds, result_folders.levelled, 0.05
    for version, binary in ((2.2, False), (2.2, True), (4.0, False), (4.1, False), (4.1, True)):
        whole = mesh_files.write_boxes(folder / "whole.msh", version, binary).read_bytes()
        yield (
            f"meshes of gmsh {version}, {'bytes' if binary else 'text'}",
            stored_inputs.flipped(whole),
            lambda content: on_mesh(folder, content),
            0.05,
        )


def on_mesh(folder, content):
    """Read a mesh beside options that gmsh would run."""
    ran, path = folder / "ran", folder / "part.msh"
    (folder / "part.msh.opt").write_text(f'SystemCall "touch {ran}";', encoding="utf-8")
    path.write_bytes(content)
    outcome = stored_inputs.read(path, read_gmsh_file)
    assert not ran.exists()
    return outcome


def on_heights(folder, heights, data):
    """Run a scene on heights of its own."""
    np.save(folder / "heights.npy", heights)
    data = scene_inputs.put(data, "surface.file", "heights.npy")
    path = folder / "scene.toml"
    path.write_bytes(scene_inputs.toml(data).encode())
    return scene_inputs.ran(path)


def campaign(strategy, attempt, count, number):
    """Try inputs; return outcomes, times [s] and a trace of each different defect."""
    outcomes, times, defects = Counter(), [], {}

    def tried(drawn):
        began = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        signal.setitimer(signal.ITIMER_REAL, LONGEST_WAIT)
        try:
            outcomes[attempt(drawn)] += 1
        except (Exception, Hang) as error:
            outcomes["DEFECT"] += 1
            where = traceback.extract_tb(error.__traceback__)[-1]
            told = "".join(traceback.format_exception(error))[-1500:]
            defects.setdefault((type(error), where.filename, where.lineno), (drawn, told))
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.setitimer(signal.ITIMER_REAL, 0)
        times.append(time.process_time() - began)

    run = given(strategy)(tried)
    run = settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )(seed(number)(run))
    run()
    return outcomes, times, defects


def main():
    """Run the campaign and print a line for every kind of input."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="one kind of input, by the begin of its name")
    choice = parser.parse_args()
    os.environ["PATCHLAW_CACHE"] = "off"
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    warnings.simplefilter("error", RuntimeWarning)
    np.set_printoptions(threshold=20, edgeitems=2)

    def late(*_):
        raise Hang

    signal.signal(signal.SIGPROF, late)
    signal.signal(signal.SIGALRM, late)
    found = False
    # texts that are taken for a folder are folders in the working one
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for name, strategy, attempt, share in doors(Path(folder)):
            if choice.only and not name.startswith(choice.only):
                continue
            count = round(choice.inputs * share)
            outcomes, times, defects = campaign(strategy, attempt, count, choice.seed)
            told = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common())
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(
                f"{name}: {len(times)} inputs: {told}; {1e3 * np.mean(times):.1f} ms each, "
                f"the slowest {max(times):.2f} s; {memory:.0f} MB",
                flush=True,
            )
            for drawn, trace in defects.values():
                found = True
                print(f"{str(drawn)[:2000]}\n{trace}\n")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
