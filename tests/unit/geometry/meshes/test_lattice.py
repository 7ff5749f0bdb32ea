import ctypes
import subprocess
import sys
import time
from types import SimpleNamespace

import gmsh
import numpy as np
import pytest

from geometry import BlockShape, flat_block
from geometry.meshes.lattice import Segment, gmsh_session, is_initialised

SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2))


@pytest.fixture
def session():
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    yield
    gmsh.finalize()


@pytest.mark.parametrize("cells, growth", [(1, 5.0), (4, 1.0), (4, 8.0), (3, 0.1)])
def test_segments_grow_geometrically(cells, growth):
    segment = Segment(start=-1.0, end=3.0, cells=cells, growth=growth)
    sizes = np.diff(segment.ticks)
    assert segment.ticks[0] == -1.0 and segment.ticks[-1] == 3.0 and len(sizes) == cells
    assert sizes[-1] / sizes[0] == pytest.approx(growth if cells > 1 else 1.0, rel=1e-12)
    np.testing.assert_allclose(sizes[1:] / sizes[:-1], segment.ratio, rtol=1e-12)
    assert segment.narrowest == pytest.approx(sizes.min(), rel=1e-12)


def test_own_session_ends_with_the_context():
    assert not is_initialised(gmsh)
    with flat_block(SHAPE) as model:
        assert is_initialised(gmsh) and len(model.mesh.getNodes()[0]) == 27
    assert not is_initialised(gmsh)


def test_a_callers_session_is_seen(session):
    assert is_initialised(gmsh) and gmsh.option.getNumber("Mesh.ElementOrder") == 1.0
    gmsh.finalize()
    assert not is_initialised(gmsh)
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    assert is_initialised(gmsh)


RECYCLED = """
import numpy as np
from geometry import BlockShape, flat_block

arrays = [np.full(n // 4, {}, dtype=np.int32) for n in range(64, 60_000, 16) for _ in range(3)]
del arrays
with flat_block(BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1))) as model:
    print(len(model.mesh.getNodes()[0]), "nodes")
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
    assert (done.returncode, done.stdout) == (0, "8 nodes\n"), done.stderr


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
    with flat_block(SHAPE), pytest.raises(Exception, match=r"\S"):
        gmsh.option.getNumber("Mesh.NoSuchOption")
    assert gmsh.option.getNumber("General.AbortOnError") == 4.0
    gmsh.option.setNumber("General.AbortOnError", 2)


def test_own_session_ends_after_an_error():
    with pytest.raises(ZeroDivisionError), flat_block(SHAPE):
        1 / 0  # noqa: B018
    assert not is_initialised(gmsh)


TAKEN = (
    "import signal; seen = lambda number, frame: None; signal.signal(signal.SIGINT, seen);"
    "from geometry import BlockShape, flat_block;"
    "shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1));"
    "session = flat_block(shape); session.__enter__();"
    "inside = signal.getsignal(signal.SIGINT); session.__exit__(None, None, None);"
    "import macro; assert inside is signal.getsignal(signal.SIGINT) is seen"
)


def test_gmsh_leaves_sigint_to_who_has_it(root):
    """Already its import takes it, so that this needs a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", TAKEN], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_meshes_can_be_built_again_and_again():
    for _ in range(3):
        with flat_block(SHAPE) as model:
            assert len(model.mesh.getNodes()[0]) == 27


def test_a_callers_session_goes_on(session):
    gmsh.model.add("mine")
    gmsh.model.geo.addPoint(0.0, 0.0, 0.0)
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 2)
    models = gmsh.model.list()
    with flat_block(SHAPE) as model:
        types, cells, _ = model.mesh.getElements(3)
        assert list(types) == [5] and len(cells[0]) == 8  # hexahedra of first order
    assert gmsh.model.getCurrent() == "mine" and gmsh.model.list() == models
    assert gmsh.model.getEntities() == [(0, 1)]
    assert gmsh.option.getNumber("Mesh.ElementOrder") == 2.0


def test_a_callers_session_survives_an_error(session):
    gmsh.model.add("mine")
    with pytest.raises(ZeroDivisionError), gmsh_session("other"):
        1 / 0  # noqa: B018
    assert gmsh.model.getCurrent() == "mine" and is_initialised(gmsh)


def test_gmsh_stays_silent(capfd):
    with flat_block(SHAPE):
        pass
    assert capfd.readouterr() == ("", "")


def test_the_largest_usual_block_takes_about_a_second():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(40, 40, 25), grading=4.0)
    start = time.perf_counter()
    with flat_block(shape) as model:
        assert len(model.mesh.getElements(3)[1][0]) == 40_000
    assert time.perf_counter() - start < 3.0  # 0.1 s measured; wide for a busy machine
