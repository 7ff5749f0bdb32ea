"""What folders of tests share: bodies solved for once, commands under MPI, counted iterations."""

import fcntl
import gc
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

# as many workers as cores, so that threads would only be in each other's way; before numpy comes
os.environ.setdefault("OMP_NUM_THREADS", "1")

with suppress(PackageNotFoundError):  # MPI as a wheel is found by dolfinx once it is loaded
    version("mpich")
    import mpi4py.MPI  # noqa: F401
import numpy as np
from helpers.mpi_environment import BESIDE_OTHERS
from helpers.waiting_ranks import WaitingRanks, alone

# as in a terminal, also where the tests are started in the background or by nohup
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
# modules stay compiled for all the processes that tests start, as they do for users
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# nothing is left in the home of who runs the tests
os.environ["PATCHLAW_CACHE"] = "off"
SOLVED_ANEW = ("tests/parallel/", "tests/unit/macro/")
"""Where the compliance of a body is itself what is tested."""


LONGEST = (
    "house/test_wheel.py", "house/test_demos.py", "unit/multiscale/test_worn_laws.py",
    "parallel/test_scene_bodies.py", "house/test_my_surface.py", "house/test_style.py",
    "parallel/test_choice_ranks.py", "parallel/test_resume.py",
    "verification/test_finite_slopes_periodic.py", "parallel/test_four_ranks.py",
    "parallel/test_memory_ranks.py", "parallel/test_faults.py",
)  # fmt: skip
"""Files of half a minute and more, begun first, so that no worker waits for one at the end."""


def pytest_ignore_collect(collection_path, config):
    """Pass over files that say nothing of long tests where those alone are asked for."""
    if config.option.markexpr.startswith("long") and collection_path.match("test_*.py"):
        text = collection_path.read_text(encoding="utf-8")
        return None if re.search(r"mark\.long\b|\bRANKS\b", text) else True
    return None


def _thin_crossed_cases(items):
    """Mark crossed cases of long tests as slow, but for the few in which every value occurs."""
    functions = {}
    for item in items:
        if item.get_closest_marker("long") and len(list(item.iter_markers("parametrize"))) > 1:
            functions.setdefault((item.path, item.originalname), []).append(item)
    for cases in functions.values():
        places = []
        for mark in cases[0].iter_markers("parametrize"):
            names = mark.args[0]
            names = names.replace(" ", "").split(",") if isinstance(names, str) else names
            values = [tuple(id(case.callspec.params[name]) for name in names) for case in cases]
            order = list(dict.fromkeys(values))
            places.append([order.index(value) for value in values])
        counts = [max(one) + 1 for one in places]
        kept = {tuple(case % count for count in counts) for case in range(max(counts))}
        for case, place in zip(cases, zip(*places, strict=True), strict=True):
            if place not in kept:
                case.add_marker("slow")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Begin with the files that take longest, then with those of most tests."""
    _thin_crossed_cases(items)
    tests = Counter(item.path for item in items)
    first = {Path(__file__).parent / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: (first.get(item.path, len(first)), -tests[item.path]))


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_collection():
    """Let one worker of a fresh checkout compile the tests, some seconds of work, for all."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    compiled = next(Path(__file__).parent.glob("verification/__pycache__/*-pytest-*.pyc"), None)
    if run is None or compiled:
        yield
        return
    with open(Path(tempfile.gettempdir()) / f"patchlaw-tests-{run}.compiled", "w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        yield


@contextmanager
def _alone(exclusively):
    """Wait until no other worker runs a test on ranks, or any test where this one is such a test.

    Ranks wait for each other by asking again and again: beside a worker that computes, two of them
    took ten to twenty times as long. The turnstile lets no one overtake who waits.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    if run is None:
        yield
        return
    place = Path(tempfile.gettempdir()) / f"patchlaw-tests-{run}"
    with open(f"{place}.turnstile", "w") as turnstile, open(f"{place}.cores", "w") as cores:
        fcntl.flock(turnstile, fcntl.LOCK_EX)
        fcntl.flock(cores, fcntl.LOCK_EX if exclusively else fcntl.LOCK_SH)
        fcntl.flock(turnstile, fcntl.LOCK_UN)
        yield


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    """Give the cores to tests on ranks alone."""
    with _alone(item.nodeid.startswith("tests/parallel/")):
        yield


def pytest_sessionfinish():
    """Leave no locks behind."""
    if run := os.environ.get("PYTEST_XDIST_TESTRUNUID"):
        for lock in Path(tempfile.gettempdir()).glob(f"patchlaw-tests-{run}.*"):
            lock.unlink(missing_ok=True)


def pytest_collection_finish():
    """Keep what all tests have loaded out of later collections of garbage.

    Every run that had a mesh ends with one. With 300,000 objects each took 0.2 s, 13 % of all.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def shared_bodies(request, tmp_path_factory):
    """Let the other tests of a session read the compliance of a block that one has solved for."""
    with pytest.MonkeyPatch.context() as patch:
        if not request.node.nodeid.startswith(SOLVED_ANEW):
            folder = tmp_path_factory.getbasetemp()
            if "PYTEST_XDIST_WORKER" in os.environ:  # beside the folders of all workers
                folder = folder.parent
            patch.setenv("PATCHLAW_CACHE", str(folder / "bodies"))
        yield


@pytest.fixture(scope="session")
def root():
    """Folder of the project."""
    return Path(__file__).parents[1]


@pytest.fixture(scope="session")
def mpirun(root):
    """Return a function that runs Python with some words on a number of ranks."""

    def start(ranks, *words, timeout=240):
        command = ["mpirun", "-n", str(ranks), sys.executable, *map(str, words)]
        return subprocess.run(
            command,
            cwd=root,
            env=os.environ | BESIDE_OTHERS | {"PYTHONPATH": str(root)},
            capture_output=True,
            text=True,
            timeout=timeout,  # a hang is a failure, not a wait
            check=False,
        )

    return start


@pytest.fixture(scope="session")
def waiting_ranks(root, tmp_path_factory):
    """Return what `mpirun` returns, but from ranks that wait for the next command, or this one."""
    started = {}

    def run(ranks, *words, timeout=240):
        if ranks == 1:
            return alone(list(map(str, words)))
        if ranks not in started or not started[ranks].are_waiting:
            folder = tmp_path_factory.mktemp(f"{ranks}_ranks")
            started[ranks] = WaitingRanks(ranks, root, folder)
        return started[ranks].run(list(map(str, words)), timeout)

    yield run
    for each in started.values():
        each.end()


@pytest.fixture(scope="session")
def iterations():
    """Return a function that counts a block's iterations to 1e-8 under a load of all frequencies.

    It makes sure of the true residual.
    """

    def count(block):
        load = block.stiffness.createVecRight()
        load.array[:] = np.random.default_rng(5).standard_normal(block.owned_dofs)
        load.pointwiseMult(load, block.free)
        found, residual = load.duplicate(), load.duplicate()
        block.solver.setTolerances(rtol=1e-8)
        block.solver.solve(load, found)
        assert block.solver.reason > 0
        block.stiffness.mult(found, residual)
        residual.axpy(-1.0, load)
        assert residual.norm() < 1.1e-8 * load.norm()
        return block.solver.its

    return count
