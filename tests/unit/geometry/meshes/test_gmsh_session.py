import ctypes
import subprocess
import sys
from types import SimpleNamespace

import gmsh
import pytest

from patchlaw.geometry.meshes.gmsh_block import gmsh_session, is_initialised


def boxed(gmsh):
    """Mesh a box in the current model and return the number of its nodes."""
    gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(3)
    return len(gmsh.model.mesh.getNodes()[0])


@pytest.fixture
def session():
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    yield
    gmsh.finalize()


def test_own_session_ends_with_the_context():
    assert not is_initialised(gmsh)
    with gmsh_session("box") as gmsh_:
        assert is_initialised(gmsh) and boxed(gmsh_) >= 8
    assert not is_initialised(gmsh)


def test_a_callers_session_is_seen(session):
    assert is_initialised(gmsh) and gmsh.option.getNumber("Mesh.ElementOrder") == 1.0
    gmsh.finalize()
    assert not is_initialised(gmsh)
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    assert is_initialised(gmsh)


RECYCLED = """
import numpy as np
from patchlaw.geometry.meshes.gmsh_block import gmsh_session

arrays = [np.full(n // 4, {}, dtype=np.int32) for n in range(64, 60_000, 16) for _ in range(3)]
del arrays
with gmsh_session("empty") as gmsh:
    print(len(gmsh.model.mesh.getNodes()[0]), "nodes")
"""


@pytest.mark.parametrize("value", [4, 1])
def test_recycled_memory_does_not_end_the_process(root, value):
    """gmsh 4.8, asked before its first session, ended silently where its memory had held a 4."""
    done = subprocess.run(
        [sys.executable, "-c", RECYCLED.format(value)],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "0 nodes\n"), done.stderr


class NeverAsked:
    """A gmsh without ``isInitialized`` that must not be called before its first session."""

    lib = ctypes.CDLL(None)  # has no context of gmsh

    def __getattr__(self, name):
        if name == "isInitialized":
            raise AttributeError(name)
        raise AssertionError(f"gmsh.{name} was asked for")


def test_gmsh_is_not_called_before_its_first_session():
    assert not is_initialised(NeverAsked())


@pytest.mark.parametrize("open_", [0, 1])
def test_newer_releases_are_asked(open_):
    assert is_initialised(SimpleNamespace(isInitialized=lambda: open_)) == bool(open_)


def test_errors_of_gmsh_are_exceptions_whatever_the_caller_chose(session):
    gmsh.option.setNumber("General.AbortOnError", 4)
    with gmsh_session("other"), pytest.raises(Exception, match=r"\S"):
        gmsh.option.getNumber("Mesh.NoSuchOption")
    assert gmsh.option.getNumber("General.AbortOnError") == 4.0
    gmsh.option.setNumber("General.AbortOnError", 2)


def test_own_session_ends_after_an_error():
    with pytest.raises(ZeroDivisionError), gmsh_session("other"):
        1 / 0  # noqa: B018
    assert not is_initialised(gmsh)


TAKEN = (
    "import signal; seen = lambda number, frame: None; signal.signal(signal.SIGINT, seen);"
    "from patchlaw.geometry.meshes.gmsh_block import gmsh_session;"
    "session = gmsh_session('box'); session.__enter__();"
    "inside = signal.getsignal(signal.SIGINT); session.__exit__(None, None, None);"
    "import patchlaw.macro.bodies; assert inside is signal.getsignal(signal.SIGINT) is seen"
)


def test_gmsh_leaves_sigint_to_who_has_it(root):
    """Already its import takes it, so that this needs a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", TAKEN], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_sessions_can_begin_again_and_again():
    counts = set()
    for _ in range(3):
        with gmsh_session("box") as gmsh_:
            counts.add(boxed(gmsh_))
    assert len(counts) == 1


def test_a_callers_session_goes_on(session):
    gmsh.model.add("mine")
    gmsh.model.geo.addPoint(0.0, 0.0, 0.0)
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 2)
    models = gmsh.model.list()
    with gmsh_session("box") as gmsh_:
        boxed(gmsh_)
        assert list(gmsh_.model.mesh.getElements(3)[0]) == [4]  # tetrahedra of first order
    assert gmsh.model.getCurrent() == "mine" and gmsh.model.list() == models
    assert gmsh.model.getEntities() == [(0, 1)]
    assert gmsh.option.getNumber("Mesh.ElementOrder") == 2.0


def test_a_callers_session_survives_an_error(session):
    gmsh.model.add("mine")
    with pytest.raises(ZeroDivisionError), gmsh_session("other"):
        1 / 0  # noqa: B018
    assert gmsh.model.getCurrent() == "mine" and is_initialised(gmsh)


def test_gmsh_stays_silent(capfd):
    with gmsh_session("box") as gmsh_:
        boxed(gmsh_)
    assert capfd.readouterr() == ("", "")
