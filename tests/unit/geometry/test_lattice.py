import subprocess
import sys
import time

import gmsh
import numpy as np
import pytest

from geometry import BlockShape, flat_block
from geometry.lattice import Segment, gmsh_session

SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2))


def is_open():
    """Ask as every release of gmsh answers: no session has no elements of order 1."""
    try:
        return gmsh.option.getNumber("Mesh.ElementOrder") >= 1.0
    except Exception:
        return False


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


def test_own_session_ends_with_the_context():
    assert not is_open()
    with flat_block(SHAPE) as model:
        assert is_open() and len(model.mesh.getNodes()[0]) == 27
    assert not is_open()


def test_own_session_ends_after_an_error():
    with pytest.raises(ZeroDivisionError), flat_block(SHAPE):
        1 / 0  # noqa: B018
    assert not is_open()


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
    assert gmsh.model.getCurrent() == "mine" and is_open()


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
