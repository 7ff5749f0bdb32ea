"""What ranks share is divided over nodes, what every rank holds is counted for all on a node."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.multiscale import Scene, make_setup
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.machine import (
    ClusterNodes,
    MemoryRequest,
    cluster_nodes,
    control_group_memory,
    memory_of_this_node,
)
from patchlaw.multiscale.scene import memory as cost
from patchlaw.multiscale.scene.memory import body_request, scene_requests, shortage_warnings
from patchlaw.support import InputError

PAPER = Path(__file__).parents[3] / "demos" / "scenes" / "paper.toml"
LARGE = ("block.cells=[500, 500, 200]",)  # 5·10⁷ cells
MESHED = ("coupling.interface=pointwise", *LARGE)  # 250 GB
GB = 1e9


def scene(*words):
    return Scene.load(PAPER, ["surface.grid=[64, 64]", *words])


def requests(given):
    return scene_requests(given)


def check_memory(given, nodes):
    cost.check_memory(nodes, requests(given))


def of(count, *, ranks=1, memory=64.0):
    return ClusterNodes(ranks=(ranks,) * count, memory=memory * GB)


class Job:
    """A communicator's rank among others, on the given hosts."""

    def __init__(self, hosts, memories=None):
        self.hosts, self.size = hosts, len(hosts)
        self.memories = memories or [64.0 * GB] * len(hosts)
        self.freed = 0

    def Split_type(self, kind):
        assert kind == MPI.COMM_TYPE_SHARED
        return self

    def Free(self):
        self.freed += 1

    rank = 0  # of its node, as Split_type returns

    def allgather(self, value):
        first = [host not in self.hosts[:place] for place, host in enumerate(self.hosts)]
        return [
            (self.hosts.count(host) if begins else 0, memory)
            for host, begins, memory in zip(self.hosts, first, self.memories, strict=True)
        ]


def test_nodes_of_a_job():
    job = Job("aabbbc", [64 * GB, 64 * GB, 32 * GB, 48 * GB, 48 * GB, 64 * GB])
    assert cluster_nodes(job) == ClusterNodes(ranks=(2, 3, 1), memory=32 * GB)
    assert job.freed == 1  # communicators are few
    assert (cluster_nodes(None) == cluster_nodes(Job("a")) == ClusterNodes() == ClusterNodes(
        memory=memory_of_this_node(),
    ))  # fmt: skip


def test_a_block_of_many_nodes_is_let_through_there():
    given = scene(*MESHED)
    check_memory(given, of(8))
    check_memory(given, of(8, ranks=64))
    check_memory(given, of(4))
    text = (
        "block.cells = [500, 500, 200]: needs about 250 GB of memory (allowed: what fits into "
        "one node of 64 GB; 4 such nodes would do, filled evenly by mpirun over several hosts)"
    )
    with pytest.raises(InputError, match=re.escape(text)):
        check_memory(given, of(1))
    with pytest.raises(InputError, match=r"3 nodes of 64 GB with 64 ranks; 4 such nodes would do"):
        check_memory(given, of(3, ranks=64))
    # two nodes of 16, where the fullest would have 15/16 of the block
    with pytest.raises(InputError, match=r"2 nodes of 200 GB with 15 ranks; 2 such nodes would do"):
        check_memory(given, ClusterNodes(ranks=(15, 1), memory=200 * GB))
    check_memory(given, ClusterNodes(ranks=(8, 8), memory=200 * GB))


def test_what_every_rank_holds_is_counted_for_all_on_a_node():
    given = scene("patches.grid=[128, 128]", "surface.grid=[256, 256]", "block.cells=[8, 8, 4]")
    check_memory(given, of(1))
    check_memory(given, of(100, ranks=5))  # 5 × 10.7 GB
    text = (
        "patches.grid = [128, 128]: the interaction of all patches with each other needs about "
        "10.7 GB of memory (allowed: what fits into 100 nodes of 64 GB with 6 ranks; 5 ranks on "
        "a node would do, for each holds it all)"
    )
    with pytest.raises(InputError, match=re.escape(text)):
        check_memory(given, of(100, ranks=6))
    with pytest.raises(InputError, match=r"what fits into one node of 8 GB\)"):  # nothing helps
        check_memory(given, of(1, memory=8.0))
    with pytest.raises(InputError, match="1 rank on a node would do"):
        check_memory(given, of(2, ranks=2, memory=16.0))


def test_a_surface_is_made_once_and_held_by_all():
    large = scene("surface.grid=[20000, 20000]")  # 40 GB while it is made, 6.8 GB from then on
    check_memory(large, of(1))
    check_memory(large, of(2, ranks=4))
    for crowded in (of(1, memory=39.0), of(2, ranks=5)):
        with pytest.raises(InputError, match=r"\[20000, 20000\]: needs about 40 GB"):
            check_memory(large, crowded)


def test_isolated_laws_are_dealt_to_the_ranks():
    # 40 000 laws of 3.6 kB, 0.144 GB on every rank, and 0.456 GB while they are made
    words = ("patches.grid=[200, 200]", "surface.grid=[800, 800]")
    laws = {
        kind: next(
            request
            for request in requests(scene(*words, f"coupling.kind={kind}"))
            if request.purpose == "a law for every patch"
        )
        for kind in ("isolated", "consistent")
    }
    held, while_made = 40_000 * 3_600, 40_000 * 11_400
    sizes = {kind: (law.per_rank, law.shared, law.root_only) for kind, law in laws.items()}
    assert sizes == {"isolated": (held, while_made, 0.0), "consistent": (held, 0.0, while_made)}


def test_a_plan_says_what_nodes_a_run_needs():
    one = of(1)
    setup = make_setup(scene(*MESHED), nodes=replace(one, extensible=True))
    (warning,) = shortage_warnings(setup.about.memory_requests(), one)
    assert warning == (
        "block.cells = (500, 500, 200): needs about 250 GB of memory; there is one node of 64 GB; "
        "4 such nodes would do, filled evenly by mpirun over several hosts"
    )
    assert not list(shortage_warnings(setup.about.memory_requests(), of(4)))
    with pytest.raises(InputError, match="one node of 30 GB"):  # of which no number helps
        words = ("patches.grid=[64, 64]", "surface.grid=[20000, 20000]")
        make_setup(scene(*words), nodes=replace(of(1, memory=30.0), extensible=True))


@pytest.mark.long
def test_the_reference_is_shared_but_for_its_meshing():
    large = ("coupling.kind=reference", "reference.fine='1.3 um'", "reference.meshes=1")
    with pytest.raises(InputError, match=r"the reference needs about .* such nodes would do"):
        make_setup(scene(*large), nodes=of(1))
    setup = make_setup(scene(*large), nodes=of(8))
    (first, *_) = shortage_warnings(setup.about.memory_requests(), of(1))
    assert "the reference needs about" in first
    usual = ("coupling.kind=reference", "reference.meshes=1")
    setup = make_setup(scene(*usual))
    least = setup.rough_meshes.gathered
    assert 0.0 < least < 0.2 * setup.rough_meshes.bytes
    many = ClusterNodes(ranks=(1,) * 1000, memory=0.9 * least)
    text = r"rank 0, which meshes the reference, needs about .*1000 nodes of .* GB; or few"
    with pytest.raises(InputError, match=text):
        make_setup(scene(*usual), nodes=many)


@pytest.mark.parametrize("kind", ["analytic", "concurrent", "consistent", "reference"])
def test_cells_of_a_block_take_memory_only_where_it_is_meshed(kind):
    words = (*LARGE, f"coupling.kind={kind}", "micro.model=half-space")
    check_memory(scene(*words), of(1))
    fields = scene(*words, "output.fields=true")
    if kind in ("analytic", "reference"):  # without a flat block
        check_memory(fields, of(1))
        return
    with pytest.raises(InputError, match=r"block.cells = \[500, 500, 200\]: needs about 250 GB"):
        check_memory(fields, of(1))


@pytest.mark.parametrize(
    ("group", "folder", "name", "content", "found"),
    [
        ("0::/job/step", "job", "memory.max", "3000", [3e3]),
        ("0::/job/step", "", "memory.max", "max", []),
        ("4:cpu,memory:/job", "memory/job", "memory.limit_in_bytes", "5000", [5e3]),
        ("1:cpu:/job", "job", "memory.max", "3000", []),
    ],
)
def test_control_groups_limit_a_node(tmp_path, group, folder, name, content, found):
    place = tmp_path / "groups" / folder
    place.mkdir(parents=True)
    (place / name).write_text(f"{content}\n", encoding="utf-8")
    (tmp_path / "mine").write_text(f"{group}\n", encoding="utf-8")
    limits = list(control_group_memory(tmp_path / "mine", tmp_path / "groups"))
    assert limits == found
    if found:
        assert memory_of_this_node(limits) == found[0]
    assert list(control_group_memory(tmp_path / "nowhere", tmp_path / "groups")) == []
    assert memory_of_this_node([]) > 1e8


def test_limit_of_a_process_counts():
    limited = replace(of(2, ranks=4), process=4 * GB)
    assert limited.fits(MemoryRequest(shared=31 * GB)) and not limited.fits(
        MemoryRequest(shared=33 * GB)
    )
    assert limited.fits(MemoryRequest(root_only=3.9 * GB)) and not limited.fits(
        MemoryRequest(root_only=4.1 * GB)
    )
    assert (
        limited.nodes_needed(MemoryRequest(shared=33 * GB)) == 3
        and limited.nodes_needed(MemoryRequest(per_rank=4.1 * GB)) is None
    )
    text = "2 nodes of 64 GB with 4 ranks, 4 GB for a process (ulimit -v)"
    assert limited.remedy(MemoryRequest(per_rank=4.1 * GB)) == text


LIMITED = """
import resource, sys
from patchlaw.multiscale.cli.command_line import main
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]) << 20, resource.RLIM_INFINITY))
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.long
@pytest.mark.parametrize(("megabytes", "text"), [
    (900, "ulimit -v = 921600: the address space of a process is limited to less than"),
    (2000, r"of memory (allowed: what fits into one node of .* GB, 1.1 GB for a process"),
])  # fmt: skip
def test_address_space(root, megabytes, text):
    """OpenBLAS asked for its buffers for ever where there was none left."""
    words = ["plan", str(PAPER), "--set", "surface.grid=[3400, 3400]"]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(megabytes), *words], cwd=root, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert re.search(text.replace("(", r"\("), done.stderr), done.stderr


def test_memory_that_runs_out_ends_with_5(capsys, monkeypatch):
    def hungry(*given):
        np.empty(1 << 50)

    monkeypatch.setattr("patchlaw.multiscale.cli.about.print_schema", hungry)
    assert main(["schema"]) == 5
    assert "patchlaw: memory ran out: Unable to allocate 8.00 PiB" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("element", "unknowns", "steps", "measured"),
    # brake pads, benchmarks/body_solvers.py
    [("P1", 250_920, 1, 2347), ("P2", 978_000, 2, 1432)],
)
def test_bodies_take_what_their_request_says(element, unknowns, steps, measured):
    said = body_request("body", element, unknowns, steps)
    assert unknowns * measured <= said.total <= 1.5 * unknowns * measured
    assert said.sentence.startswith("the mesh of [body], its stiffness and multigrid, needs about")


def test_files_read_in_parts_burden_no_single_rank():
    whole, parts = (
        body_request("body", "P1", 1000, 1, in_parts=in_parts) for in_parts in (False, True)
    )
    assert parts.root_only == 0.0 < whole.root_only
    assert parts.shared == whole.shared


def test_earlier_states_are_kept_up_to_a_number():
    one, many, more = (body_request("body", "Q1", 1000, steps).total for steps in (1, 32, 500))
    assert one < many == more


PLAIN = ("coupling.kind=isolated", *LARGE)


def test_a_block_without_a_mesh_asks_for_what_its_solver_takes():
    condensed = scene(*PLAIN)
    sizes = {request.key: request.total for request in requests(condensed)}
    assert sizes["block.cells"] == 320.0 * 500 * 500 * 200
    check_memory(condensed, of(1))
    for more in ("coupling.interface=pointwise", "block.element=P1", "output.fields=true"):
        sizes = {request.key: request.total for request in requests(scene(*PLAIN, more))}
        assert sizes["block.cells"] == 5000.0 * 500 * 500 * 200


@pytest.mark.long
def test_what_a_block_without_a_mesh_takes_was_measured():
    """Peak memory in a process of its own, in which nothing else is large."""
    lines = (
        "import re, numpy as np",
        "from patchlaw.geometry import Material, PatchGrid",
        "from patchlaw.geometry.meshes.block import BlockShape",
        "from patchlaw.macro.compliance.face_compliance import lattice_compliance",
        "status = lambda: open('/proc/self/status').read()",
        "peak = lambda: 1024 * int(re.search(r'VmHWM:\\s*(\\d+)', status())[1])",
        "shape = BlockShape(interface=(1.0, 1.0), height=0.6, cells=(56, 56, 32))",
        "patches = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))",
        "material, before = Material(young_modulus=4e3, poisson_ratio=0.3), peak()",
        "lattice_compliance(shape, material, 'free', patches, np.arange(16), None)",
        "print((peak() - before) / (56 * 56 * 32))",
    )
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True
    )
    assert 50.0 < float(done.stdout) < 320.0
