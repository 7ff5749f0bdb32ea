"""The batch scripts of demos/hpc run on a real Slurm: one node, this machine."""

import csv
import os
import platform
import shutil
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

pytestmark = [pytest.mark.slow, pytest.mark.skipif(
    os.geteuid() != 0 or not all(map(shutil.which, ("slurmctld", "slurmd", "munged"))),
    reason="takes root and Debian's packages slurm-wlm and munge",
)]  # fmt: skip
ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "demos" / "hpc"
SCENE = ROOT / "demos" / "scenes" / "paper.toml"
SMALL = [
    "surface.grid=[64, 64]", "block.cells=[6, 6, 4]", "patches.grid=[2, 2]",
    "output.figures=false", "output.report=false",
]  # fmt: skip


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Slurm:
    """Slurm's daemons in a folder of their own, and what users type."""

    def __init__(self, folder, stack):
        self.folder, self._stack = folder, stack
        host = platform.node().partition(".")[0]
        settings = Path(__file__).with_name("slurm.conf").read_text(encoding="utf-8")
        for name, value in {
            "host": host, "folder": folder, "cores": os.cpu_count(),
            "controller_port": free_port(), "node_port": free_port(),
        }.items():  # fmt: skip
            settings = settings.replace(f"{{{name}}}", str(value))
        (folder / "slurm.conf").write_text(settings, encoding="utf-8")
        (folder / "state").mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        home = Path(sys.executable).parent
        self.environment = os.environ | {
            "SLURM_CONF": str(folder / "slurm.conf"), "PATCHLAW": f"{sys.executable} -m patchlaw",
            "PYTHONPATH": str(ROOT), "PATH": f"{home}:{os.environ['PATH']}",
            "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_btl": "^tcp", "OMPI_MCA_rmaps_base_oversubscribe": "1",
        }  # fmt: skip
        files = {name: folder / f"munge.{name}" for name in ("socket", "pid", "log", "seed")}
        words = [f"--{name}-file={file}" for name, file in files.items() if name != "socket"]
        self._daemon(
            "munged", "--force", "--foreground", f"--key-file={key}", f"--socket={files['socket']}",
            *words,
        )  # fmt: skip
        self.wait(files["socket"].exists, 20)
        self._daemon("slurmctld", "-D", "-c")
        self._daemon("slurmd", "-D", "-c")
        self.wait(lambda: "idle" in self.say("sinfo", "--noheader", "--format=%t"), 40)

    def _daemon(self, *words):
        log = self._stack.enter_context((self.folder / f"{words[0]}.out").open("w"))
        process = subprocess.Popen(words, env=self.environment, stdout=log, stderr=log)
        self._stack.callback(process.wait, timeout=30)
        self._stack.callback(process.terminate)

    def say(self, *words):
        done = subprocess.run(
            words, env=self.environment, cwd=self.folder, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        return done.stdout.strip()

    def submit(self, *words):
        number = self.say("sbatch", "--parsable", *map(str, words))
        assert number.isdigit(), number
        return number

    def show(self, job, field):
        return self.say(
            "squeue", "--noheader", "--jobs", job, "--states=all", f"--Format={field}:200"
        )

    def finish(self, job, seconds):
        """Wait for a job, array tasks included, and return the states it ended in."""
        over = {"COMPLETED", "FAILED", "TIMEOUT", "CANCELLED", "NODE_FAIL"}
        self.wait(lambda: set(self.show(job, "State").split()) <= over, seconds)
        return set(self.show(job, "State").split())

    def wait(self, happened, seconds):
        end = time.monotonic() + seconds
        while not happened():
            assert time.monotonic() < end, self.logs()
            time.sleep(0.5)

    def logs(self):
        files = [*self.folder.glob("*.out"), *self.folder.glob("*.log")]
        return "\n".join(f"{file.name}:\n{file.read_text()[-1500:]}" for file in files)


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    with ExitStack() as stack:
        started = Slurm(tmp_path_factory.mktemp("slurm"), stack)
        yield started
        started.say("scancel", "--me")  # what a failed test left running
        started.wait(lambda: not started.say("squeue", "--noheader"), 60)


def forces(out):
    with (out / "history.csv").open(encoding="utf-8") as file:
        return np.array([float(row["force_N"]) for row in csv.DictReader(file)])


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Return the forces of a run without Slurm."""

    def compute(*changes):
        from patchlaw.multiscale import Scene, run

        return np.asarray(run(Scene.load(SCENE, [*SMALL, *changes])).force_N)

    return compute


def test_a_run_on_two_ranks_finishes(slurm, reference):
    out = slurm.folder / "single"
    job = slurm.submit(SCRIPTS / "run.sbatch", SCENE, out, "--set", *SMALL, "load.steps=2")
    assert slurm.finish(job, 120) == {"COMPLETED"}, slurm.logs()
    # equations are solved to 1e-10 of the load on any number of ranks
    np.testing.assert_allclose(forces(out), reference("load.steps=2"), rtol=1e-8)


def test_the_tasks_of_an_array_share_the_seeds(slurm, reference):
    out, changes = slurm.folder / "seeds", ["load.steps=2", "coupling.kind=analytic"]
    script = SCRIPTS / "seeds.sbatch"
    job = slurm.submit("--array=1-2", script, SCENE, out, "1..3", *SMALL[:3], *changes)
    assert slurm.finish(job, 120) == {"COMPLETED"}, slurm.logs()
    assert len(list((out / "cases").glob("*/*.cases"))) == 2  # one for each task
    expected = [reference(*changes, f"surface.spectrum.seed={seed}") for seed in (1, 2, 3)]
    np.testing.assert_allclose(forces(out), np.concatenate(expected), rtol=1e-12)


def test_slurm_itself_can_start_the_ranks(slurm):
    doctor = (sys.executable, "-m", "patchlaw", "doctor")
    done = subprocess.run(
        ["srun", "--mpi=pmix", "--ntasks=2", *doctor],
        cwd=slurm.folder, env=slurm.environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "; 2 ranks with " in done.stdout


SLOW = """
import sys, time
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs.scene_run import Run
at_once = Run.load_steps
def slowly(self):
    for step in at_once(self):
        time.sleep(0.5)
        yield step
Run.load_steps = slowly
sys.exit(main())
"""


def test_a_run_longer_than_the_limit_goes_on_after_it(slurm, reference):
    """Signal before the time limit → checkpoint → back into the queue → the same history."""
    out, slow = slurm.folder / "long", slurm.folder / "slow.py"
    slow.write_text(SLOW, encoding="utf-8")
    slurm.environment["PATCHLAW"] = f"{sys.executable} {slow}"
    changes = "load.steps=100"  # which take 50 s; the signal comes 15 to 45 s after a start
    limit = ("--time=1", "--signal=B:USR1@15")
    job = slurm.submit(
        *limit, SCRIPTS / "requeue.sbatch", SCENE, out, "--set", *SMALL, changes
    )  # fmt: skip
    slurm.wait(lambda: slurm.show(job, "RestartCnt").lstrip("0").isdigit(), 100)
    assert (out / "checkpoint.state").is_file()
    assert slurm.finish(job, 300) == {"COMPLETED"}, slurm.logs()
    log = (slurm.folder / f"patchlaw-long-{job}.log").read_text(encoding="utf-8")
    assert "go on with --resume" in log
    assert log.count("load step 10/100:") == 1  # nothing was computed twice
    # equations are solved to 1e-10 of the load, from whatever start
    np.testing.assert_allclose(forces(out), reference(changes), rtol=1e-8)
