"""Ranks that wait for commands: Python, dolfinx and MPI are started once for many tests.

What a fresh process decides (signals, options of PETSc, threads, ends by a bug) is tested by
``mpirun``; all else gives the same here, 1.5 s of each rank cheaper. What a command changes in
modules or PETSc's options it has to change back.
"""

import gc
import json
import os
import runpy
import selectors
import signal
import subprocess
import sys
import time
import traceback
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from .mpi_environment import BESIDE_OTHERS


class WaitingRanks:
    """Ranks of one start of MPI.

    Args:
        ranks: Number of ranks.
        root: Folder of the project, where commands run.
        folder: Folder for pipes and for what the commands print.
    """

    def __init__(self, ranks, root, folder):
        self._ranks, self._folder, self._jobs = ranks, folder, 0
        names = *map(str, range(ranks)), "ended"
        for name in names:
            os.mkfifo(folder / name)
        # open for both ways, so that nobody waits for the other side to open
        self._pipes = [os.open(folder / name, os.O_RDWR | os.O_NONBLOCK) for name in names]
        command = ["mpirun", "-n", str(ranks), sys.executable, "-m", "helpers.waiting_ranks"]
        environment = os.environ | BESIDE_OTHERS
        environment["PYTHONPATH"] = os.pathsep.join(map(str, (root, root / "tests")))
        with (folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                [*command, str(folder)], cwd=root, env=environment,
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip

    @property
    def are_waiting(self):
        """Whether another command can be run."""
        return self._process.poll() is None

    def run(self, words, timeout):
        """Return what a command printed, rank after rank, and the code that all ended with."""
        self._jobs += 1
        order = {"words": words, "job": self._jobs, "cache": os.environ["PATCHLAW_CACHE"]}
        for pipe in self._pipes[:-1]:
            os.write(pipe, json.dumps(order).encode() + b"\n")
        codes = self._codes(timeout)
        printed = [
            "".join(
                path.read_text(encoding="utf-8") if path.exists() else ""
                for path in (self._printed(rank, name) for rank in range(self._ranks))
            )
            for name in ("stdout", "stderr")
        ]
        if len(codes) < self._ranks or len(set(codes)) > 1:
            printed[1] += f"\nof {self._ranks} ranks some ended alone, with codes {codes}\n"
            codes = [1]
        if codes[0] == 1:  # a bug may leave anything behind
            self.end(kill=True)
        return subprocess.CompletedProcess(words, codes[0], *printed)

    def _printed(self, rank, name):
        return self._folder / f"{self._jobs}-{rank}.{name}"

    def _codes(self, timeout):
        """Return the codes of the ranks that end in time; when one has failed, others soon must."""
        until, text = time.monotonic() + timeout, b""
        with selectors.DefaultSelector() as selector:
            selector.register(self._pipes[-1], selectors.EVENT_READ)
            while text.count(b"\n") < self._ranks and self.are_waiting:
                if time.monotonic() > until:
                    break
                if selector.select(timeout=0.2):
                    text += os.read(self._pipes[-1], 4096)
                    if set(text.split()) != {b"0"}:
                        until = min(until, time.monotonic() + 20.0)
        return [int(code) for code in text.split()]

    def end(self, kill=False):
        """End the ranks, if they have not ended."""
        if kill and self.are_waiting:
            os.killpg(self._process.pid, signal.SIGTERM)
        for pipe in self._pipes:
            os.close(pipe)
        self._pipes = []
        self._process.wait(timeout=60)


def alone(words):
    """Return what a command prints on one rank, this process itself, and the code it ends with."""
    path, argv, printed = list(sys.path), sys.argv, (StringIO(), StringIO())
    with redirect_stdout(printed[0]), redirect_stderr(printed[1]):
        code = _ended_with(words)
    sys.path[:], sys.argv = path, argv
    return subprocess.CompletedProcess(words, code, *(text.getvalue() for text in printed))


@contextmanager
def _printing_to(folder, name):
    """Let this process print to files."""
    kept = [os.dup(1), os.dup(2)]
    for number, stream in ((1, "stdout"), (2, "stderr")):
        file = os.open(folder / f"{name}.{stream}", os.O_WRONLY | os.O_CREAT)
        os.dup2(file, number)
        os.close(file)
    try:
        yield
    finally:
        for number, (stream, old) in enumerate(zip((sys.stdout, sys.stderr), kept, strict=True), 1):
            stream.flush()
            os.dup2(old, number)
            os.close(old)


def _ended_with(words):
    """Run what Python's command line would, and return its exit code."""
    first, *rest = words
    try:
        if first == "-m":
            sys.argv = rest
            runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
        elif first == "-c":
            sys.argv = ["-c", *rest[1:]]
            exec(compile(rest[0], "<words>", "exec"), {"__name__": "__main__"})
        else:
            sys.argv = words
            sys.path.insert(0, str(Path(first).parent))  # as Python's command line does
            runpy.run_path(first, run_name="__main__")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def _wait(folder):
    """Run commands until nobody gives any."""
    from mpi4py import MPI

    rank = MPI.COMM_WORLD.rank
    path = list(sys.path)
    with (folder / str(rank)).open() as orders, (folder / "ended").open("w") as ended:
        for line in orders:
            order = json.loads(line)
            os.environ["PATCHLAW_CACHE"] = order["cache"]
            with _printing_to(folder, f"{order['job']}-{rank}"):
                code = _ended_with(order["words"])
            sys.path[:] = path
            gc.collect()  # what is freed by all ranks is freed by all now
            if order["job"] == 1:  # modules are loaded, which later collections can pass over
                gc.freeze()
            ended.write(f"{code}\n")
            ended.flush()


if __name__ == "__main__":
    _wait(Path(sys.argv[1]))
