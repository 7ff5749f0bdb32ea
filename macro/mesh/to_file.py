"""Meshes of a body as files that all ranks read, each its part."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from dolfinx import io
from dolfinx import mesh as dmesh

from macro import compat
from macro.mesh.tagged import TaggedMesh
from macro.mesh.xdmf import NAMES
from support.collective import on_root
from support.errors import InputError


def write_mesh(tagged: TaggedMesh, path: str | Path) -> None:
    """Write a mesh with its tags and their names, to be read again by `read_mesh`.

    gmsh's files are read whole on rank 0, which takes 0.4 kB there for every cell of the mesh. The
    files written here are read in parts: 0.5 kB for every cell that a rank then has.

    Args:
        tagged: The mesh [mm].
        path: The file, ``.xdmf``; its numbers go into an ``.h5`` beside it.

    Raises:
        InputError: On all ranks, when the name ends in anything else.

    Note:
        Collective.
    """
    path = Path(path)
    if path.suffix != ".xdmf":
        raise InputError(
            "meshes are not written in this format", value=path.suffix, allowed=".xdmf"
        )
    tags = {"facets": tagged.facet_tags, "cells": _owned(tagged)}
    with compat.quiet_compiler(), io.XDMFFile(tagged.comm, str(path), "w") as file:
        file.write_mesh(tagged.mesh)
        for name, each in tags.items():
            if each is not None:
                each.name = name
                compat.write_tags(file, each, tagged.mesh)
    on_root(tagged.comm, lambda: _add_names(path, tagged))


def _owned(tagged: TaggedMesh) -> Any:
    """Return the tags of the cells that this rank owns; None where there are none."""
    if tagged.cell_tags is None:
        return None
    own = tagged.cell_tags.indices < tagged.mesh.topology.index_map(3).size_local
    indices, values = (
        np.asarray(part)[own] for part in (tagged.cell_tags.indices, tagged.cell_tags.values)
    )
    return dmesh.meshtags(tagged.mesh, 3, indices, values)


def _add_names(path: Path, tagged: TaggedMesh) -> None:
    """Add the names of the tags to a file of dolfinx, which takes no notice of them."""
    tree = ElementTree.parse(path)
    names = {"facets": dict(tagged.facet_names), "cells": dict(tagged.cell_names)}
    entry = {"Name": NAMES, "Value": json.dumps(names)}
    ElementTree.SubElement(tree.getroot(), "Information", entry)
    tree.write(path, xml_declaration=True)
