"""The free edges of a contact face."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.block_cases import block_of
from mpi4py import MPI

from benchmarks.random_bodies import drawn, mesh_of, problem_on
from patchlaw.macro.contact.other_elements import FaceEdges, free_edges, nearest_samples
from patchlaw.macro.mesh.contact_face import top_facets


@pytest.mark.parametrize("kind", ["Q1", "P1"])
def test_edges_of_a_rectangle_are_its_sides(kind):
    block = block_of(interface=(3.0, 2.0), cells=(3, 4, 1), element=kind)
    edges = free_edges(block, top_facets(block.mesh))
    assert len(edges.length) == 14
    assert edges.length.sum() == pytest.approx(10.0, rel=1e-12)
    x, y = edges.middle.T
    on_side = np.isclose(x % 3.0, 0.0) | np.isclose(y % 2.0, 0.0)
    assert on_side.all()


@pytest.mark.parametrize("seed", [8, 23])  # tetrahedra, hexahedra
def test_planes_of_symmetry_have_no_edges(seed):
    """A quarter of a ring between two of them, and the same one with its ends held in shear."""
    ring = drawn(seed)
    face, _ = problem_on(ring, mesh_of(ring, MPI.COMM_SELF))
    edges = free_edges(face.body, face.facets)
    inner = ring.length * (1.0 - 0.6 * ring.ratios[0])
    radius = np.hypot(*edges.middle.T)
    assert np.all((radius < inner) | (radius > 0.9 * ring.length))
    arcs = 0.5 * np.pi * (inner + ring.length)
    assert edges.length.sum() == pytest.approx(arcs, rel=0.02)  # chords of arcs are shorter
    floor, *ends = face.body.supports
    held = [replace(end, displacement=(0.0, 0.0, None)) for end in ends]
    whole = free_edges(replace(face.body, supports=[floor, *held]), face.facets)
    added = 2.0 * (ring.length - inner)
    assert whole.length.sum() - edges.length.sum() == pytest.approx(added, rel=1e-9)


def test_samples_that_are_as_near_share_an_edge():
    edges = FaceEdges(middle=np.array([[0.5, 0.0], [2.5, 0.0]]), length=np.ones(2))
    x, y = np.array([2.5, 0.25, 0.75, 0.5]), np.array([0.25, 0.25, 0.25, 0.75])
    first, second = nearest_samples(edges, x, y, MPI.COMM_SELF)
    assert (sorted(first[0]), first[1]) == ([1, 2], 0.5)
    assert (second[0].tolist(), second[1]) == ([0], 1.0)


class TwoRanks:
    """The communicator of two ranks, and what the other one sends to each call."""

    def __init__(self, other):
        self.other = iter(other)

    def allgather(self, own):
        return [own, next(self.other)]


def test_a_rank_without_samples_takes_no_part():
    edges = FaceEdges(middle=np.array([[0.5, 0.0]]), length=np.ones(1))
    none = np.empty(0)
    ((found, share),) = nearest_samples(edges, none, none, TwoRanks([np.array([0.1]), [2]]))
    assert (found.size, share) == (0, 0.5)
