"""Sections of gmsh's files of format 2 and 4: groups, nodes and elements.

The files are read here, because gmsh runs what it finds beside a mesh (``part.msh.opt``), and of
240 damaged files gmsh 4.8.4 took 9 for another mesh and never came back from 2, meshio 5.3.5 took 5
for another one and asked for gigabytes for 11. meshio also joins nodes that a file lacks to others,
drops all but the first of several groups, and reads no partitioned mesh.

Source:
    Gmsh reference manual, "MSH file format" and "Legacy formats".
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from patchlaw.support import Array, Counts, InputError

Table = Counts
ALLOWED = "a mesh of gmsh, format 2 or 4, beginning with $MeshFormat"
KINDS = {
    15: (0, 1, "point"), 1: (1, 2, "line"), 8: (1, 3, "line"),
    2: (2, 3, "triangle"), 9: (2, 6, "triangle"),
    3: (2, 4, "quadrilateral"), 16: (2, 8, "quadrilateral"), 10: (2, 9, "quadrilateral"),
    4: (3, 4, "tetrahedron"), 11: (3, 10, "tetrahedron"),
    5: (3, 8, "hexahedron"), 17: (3, 20, "hexahedron"), 12: (3, 27, "hexahedron"),
    6: (3, 6, "prism"), 18: (3, 15, "prism"), 13: (3, 18, "prism"),
    7: (3, 5, "pyramid"), 19: (3, 13, "pyramid"), 14: (3, 14, "pyramid"),
}  # fmt: skip
"""Dimension, nodes and name of gmsh's kinds of elements of first and second order."""
_NUMERIC = ("Entities", "PartitionedEntities", "Nodes", "Elements")


class TextNumbers:
    """Numbers between spaces and line ends.

    Args:
        content: The section.

    Raises:
        InputError: When something else stands there.
    """

    def __init__(self, content: bytes) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self._values = np.fromstring(content, sep=" ")
            except (DeprecationWarning, ValueError):
                raise InputError("a section has something else than numbers") from None
        self._at = 0

    def table(self, rows: int, kinds: str) -> Array:
        """Return the next rows of numbers, shape (rows, len(kinds)).

        Args:
            rows: Number of rows.
            kinds: What stands in a row: ``i`` an int, ``u`` a size, ``d`` a double.

        Raises:
            InputError: When the section ends before.
        """
        end = self._at + rows * len(kinds)
        if rows < 0 or end > len(self._values):
            raise _too_short()
        part = self._values[self._at : end].reshape(rows, len(kinds))
        self._at = end
        return part

    def line(self) -> int:
        """Return the next number, which stands on a line of its own, as text in any file."""
        return int(whole(self.table(1, "i"))[0, 0])

    def rest(self) -> Table:
        """Return all further numbers, which are whole."""
        return whole(self._values[self._at :])


class ByteNumbers:
    """Numbers as bytes.

    Args:
        data: The file.
        at: Where the section begins.
        order: ``<`` or ``>``, as numpy calls the order of bytes.

    Attributes:
        at: Where the next number begins.
    """

    def __init__(self, data: bytes, at: int, order: str) -> None:
        self._data, self.at = data, at
        self._types = {"i": f"{order}i4", "u": f"{order}u8", "d": f"{order}f8"}

    def table(self, rows: int, kinds: str) -> Array:
        """Return the next rows; see `TextNumbers.table`."""
        row = np.dtype([(str(k), self._types[kind]) for k, kind in enumerate(kinds)])
        if rows < 0 or self.at + rows * row.itemsize > len(self._data):
            raise _too_short()
        parts = np.frombuffer(self._data, row, rows, self.at)
        numbers = np.column_stack([parts[name] for name in row.names or ()]).astype(np.float64)
        self.at += rows * row.itemsize
        return numbers

    def line(self) -> int:
        """Return the number on the next line."""
        end = self._data.find(b"\n", self.at)
        text = self._data[self.at : max(end, self.at)].strip()
        self.at = end + 1
        if not text.isdigit():
            raise _too_short()
        return int(text)


Numbers = TextNumbers | ByteNumbers
"""The numbers of a section from its beginning on."""


def whole(values: Array) -> Table:
    """Return numbers that must be whole, such as tags.

    Args:
        values: The numbers.

    Raises:
        InputError: When one is not, or too large.
    """
    exact = np.abs(values) <= 2.0**53  # as floats
    if not exact.all() or (values != np.rint(values)).any():
        raise InputError("a number or a count of the mesh is no whole number")
    return values.astype(np.int64)


def _too_short() -> InputError:
    return InputError("a section of the file ends before all that it announces")


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """Elements of one kind.

    Attributes:
        kind: gmsh's number of the kind.
        nodes: Numbers of their nodes, shape (m, nodes).
        entity: Numbers of the volumes or surfaces that they are of, shape (m,).
        group: Their physical groups, 0 for none, shape (m,).
    """

    kind: int
    nodes: Table
    entity: Table
    group: Table


@dataclass(slots=True)
class MshContent:
    """What a file says of a mesh.

    Attributes:
        names: Names of physical groups, by dimension and number.
        groups: Physical groups of entities, by dimension and number; format 4 alone.
        parents: Numbers of the entities that parts of a partition are of, by dimension and number
            of the part; None of borders between parts, which are on no surface of the model.
        numbers: Numbers of the nodes, shape (n,).
        points: Their places, shape (n, 3).
        elements: The elements, in parts of one kind.
    """

    names: dict[tuple[int, int], str] = field(default_factory=dict)
    groups: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    parents: dict[tuple[int, int], int | None] = field(default_factory=dict)
    numbers: Table = field(default_factory=lambda: np.empty(0, np.int64))
    points: Array = field(default_factory=lambda: np.empty((0, 3)))
    elements: list[Elements] = field(default_factory=list)


def msh_content(data: bytes) -> MshContent:
    """Return what the bytes of a file say.

    Raises:
        InputError: When they are no such file, or contradict themselves.
    """
    content, seen = MshContent(), set[str]()
    version, order = _format(data)
    for name, numbers in _sections(data, order):
        if name in seen:
            raise InputError(f"the file has several sections ${name}")
        seen.add(name)
        if name == "PhysicalNames":
            _read_names(content, numbers)
        elif isinstance(numbers, bytes):
            continue
        elif name == "Nodes":
            _read_nodes(content, numbers, version)
        elif name == "Elements":
            (_read_elements if version >= 4.0 else _read_elements_2)(content, numbers, version)
        elif version >= 4.0:
            _read_entities(content, numbers, version, parts=name.startswith("Part"))
    return content


def _format(data: bytes) -> tuple[float, str]:
    """Return the version of the format, and the order of bytes: none of text."""
    if not data.strip():
        raise InputError("the file is empty")
    head = re.match(rb"\s*(?:\$(?!MeshFormat)[\s\S]*?^)?\$MeshFormat\s*?\n(.*)", data, re.M)
    if head is None:
        raise InputError("this is no mesh of gmsh", allowed=ALLOWED)
    words = head[1].split()
    known = rb"2(\.[0-2]0*)?|4(\.[01]0*)?"  # Netgen writes 2.000000
    if len(words) != 3 or not re.fullmatch(known, words[0]) or words[1] not in (b"0", b"1"):
        shown = words[0].decode("ascii", "replace") if words else ""
        raise InputError("unknown format", value=shown, allowed=ALLOWED)
    if words[1] == b"0":
        return float(words[0]), ""
    one = data[head.end() + 1 : head.end() + 5]
    orders = {(1).to_bytes(4, "little"): "<", (1).to_bytes(4, "big"): ">"}
    if one not in orders or words[2] != b"8":
        raise InputError("a binary file whose numbers have another size", allowed=ALLOWED)
    return float(words[0]), orders[one]


def _sections(data: bytes, order: str) -> Iterator[tuple[str, Numbers | bytes]]:
    """Yield the sections that matter, with their numbers, or as they are."""
    at = 0
    while (head := re.compile(rb"^\$(\w+)[ \t\r]*\n", re.M).search(data, at)) is not None:
        name, at = head[1].decode("ascii"), head.end()
        if name == "ParametricNodes":
            raise InputError(
                "the file has its nodes in $ParametricNodes, with parameters on surfaces",
                allowed="$Nodes: Mesh.SaveParametric = 0, or format 4",
            )
        if order and name in _NUMERIC:
            numbers = ByteNumbers(data, at, order)
            yield name, numbers
            at = numbers.at
        end = re.compile(rb"^\s*\$End" + head[1] + rb"\b", re.M).search(data, at)
        if end is None:
            raise InputError(f"the section ${name} has no end")
        if name == "PhysicalNames":
            yield name, data[at : end.start()]
        elif not order and name in _NUMERIC:
            yield name, TextNumbers(data[at : end.start()])
        at = end.end()


def _read_names(mesh: MshContent, content: Numbers | bytes) -> None:
    """Take the names of physical groups."""
    assert isinstance(content, bytes)
    for line in re.finditer(rb'^\s*(\d)\s+(-?\d+)\s+"(.*)"\s*$', content, re.M):
        key = int(line[1]), abs(int(line[2]))
        name = line[3].decode("utf-8", "replace").rstrip()  # through .med gmsh fills it to 80
        for (dimension, other), known in mesh.names.items():
            if dimension == key[0] and known == name and other != key[1]:
                raise InputError(
                    f"physical groups {other} and {key[1]} have the same name", value=name
                )
        mesh.names[key] = name


def _read_entities(mesh: MshContent, numbers: Numbers, version: float, *, parts: bool) -> None:
    """Take the physical groups of points, curves, surfaces and volumes, or of parts of them."""
    if parts:
        numbers.table(1, "u")
        numbers.table(_count(numbers), "ii")
    counts = whole(numbers.table(1, "uuuu"))[0]
    for dimension, count in enumerate(counts):
        for _ in range(count):
            tag = _count(numbers, "i")
            if parts:
                of, parent = whole(numbers.table(1, "ii"))[0].tolist()
                mesh.parents[dimension, tag] = parent if of == dimension else None
                numbers.table(_count(numbers), "i")
            numbers.table(1, "d" * (3 if dimension == 0 and version > 4.0 else 6))
            groups = whole(numbers.table(_count(numbers), "i")).ravel()
            mesh.groups[dimension, tag] = np.abs(groups).tolist()
            if dimension:
                numbers.table(_count(numbers), "i")


def _read_nodes(mesh: MshContent, numbers: Numbers, version: float) -> None:
    """Take numbers and places of the nodes."""
    tables = [np.empty((0, 4))]
    if version < 4.0:
        tables += [numbers.table(numbers.line(), "iddd")]
    else:
        blocks = whole(numbers.table(1, "uuuu" if version > 4.0 else "uu"))[0, 0]
        for _ in range(blocks):
            *place, parametric = whole(numbers.table(1, "iii"))[0]
            dimension, count = int(place[0 if version > 4.0 else 1]), _count(numbers)
            if dimension not in range(4):
                raise InputError("a section of the file has nodes that make no sense")
            further = "d" * (3 + (dimension if parametric else 0))
            if version > 4.0:
                tags = numbers.table(count, "u")
                tables += [np.hstack([tags, numbers.table(count, further)[:, :3]])]
            else:
                tables += [numbers.table(count, "i" + further)[:, :4]]
    table = np.concatenate(tables)
    mesh.numbers, mesh.points = whole(table[:, 0]), table[:, 1:]


def _read_elements(mesh: MshContent, numbers: Numbers, version: float) -> None:
    """Take the elements of format 4, entity by entity."""
    blocks = whole(numbers.table(1, "uuuu" if version > 4.0 else "uu"))[0, 0]
    for _ in range(blocks):
        first, second, kind = map(int, whole(numbers.table(1, "iii"))[0])
        entity, count = (second if version > 4.0 else first), _count(numbers)
        dimension, nodes, _ = _kind(kind)
        table = whole(numbers.table(count, ("u" if version > 4.0 else "i") * (1 + nodes)))
        number = mesh.parents.get((dimension, entity), entity)
        if number is None:  # gmsh gives borders the group of their volume, as one of surfaces
            continue
        groups = mesh.groups.get((dimension, entity), [])
        if len(set(groups)) > 1 and count:
            known = [mesh.names.get((dimension, group), str(group)) for group in groups]
            kind_of = {2: "surface", 3: "volume"}.get(dimension, "curve")
            raise InputError(
                f"{kind_of} {entity} of the mesh is in several physical groups: "
                + " and ".join(map(repr, known)),
                allowed=f"at most one group for a {kind_of}",
            )
        group = np.full(count, groups[0] if groups else 0)
        mesh.elements += [
            Elements(kind=kind, nodes=table[:, 1:], entity=np.full(count, number), group=group)
        ]


def _read_elements_2(mesh: MshContent, numbers: Numbers, _version: float) -> None:
    """Take the elements of format 2, each of which has its group and its entity."""
    count = numbers.line()
    if isinstance(numbers, TextNumbers):
        tables = _rows_of_text(numbers.rest(), count)
    else:
        tables = _rows_of_bytes(numbers, count)
    for kind, tags, table in tables:
        group = np.abs(table[:, 0]) if tags > 0 else np.zeros(len(table), np.int64)
        entity = table[:, 1] if tags > 1 else group
        mesh.elements += [Elements(kind=kind, nodes=table[:, tags:], entity=entity, group=group)]


def _rows_of_bytes(numbers: Numbers, count: int) -> Iterator[tuple[int, int, Table]]:
    """Yield kind, number of tags, and tags with nodes of elements of binary files."""
    while count > 0:
        kind, rows, tags = map(int, whole(numbers.table(1, "iii"))[0])
        if rows < 1 or not 0 <= tags <= 100_000:
            raise InputError("a section of the file has elements that make no sense")
        _, nodes, _ = _kind(kind)
        yield kind, tags, whole(numbers.table(rows, "i" * (1 + tags + nodes)))[:, 1:]
        count -= rows


def _rows_of_text(values: Table, count: int) -> Iterator[tuple[int, int, Table]]:
    """Yield kind, number of tags, and tags with nodes of elements of text files."""
    flat, at = values.data, 0
    starts: dict[tuple[int, int], list[int]] = {}
    for _ in range(count):
        kind, tags = (flat[at + 1], flat[at + 2]) if at + 3 <= len(flat) else (0, -1)
        if tags < 0:
            raise _too_short()
        starts.setdefault((kind, tags), []).append(at + 3)
        at += 3 + tags + _kind(kind)[1]
    if at > len(flat):
        raise _too_short()
    for (kind, tags), first in starts.items():
        width = tags + KINDS[kind][1]
        yield kind, tags, values[np.array(first)[:, None] + np.arange(width)]


def _kind(kind: int) -> tuple[int, int, str]:
    """Return dimension, nodes and name of a kind of elements."""
    if kind not in KINDS:
        raise InputError(
            f"the mesh has elements of gmsh's kind {kind}",
            allowed="elements of first or second order",
        )
    return KINDS[kind]


def _count(numbers: Numbers, kind: str = "u") -> int:
    """Return the next number, a size unless it is said to be an int."""
    return int(whole(numbers.table(1, kind))[0, 0])
