"""The scene: everything a run needs to know, read and checked before anything runs; its identity.

Keys that are gone are refused, too, with what to write instead.

The identity is what the numbers of a scene depend on: its keys, the content of the files it names,
the version. Results that were stored go on, or stand for a scene, only where none of it changed.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from patchlaw.multiscale.scene.rules import check_together
from patchlaw.multiscale.scene.schema import flat, keys_beside, read, scene_keys, to_dict
from patchlaw.multiscale.scene.sections import SceneSections
from patchlaw.support import (
    KEY,
    InputError,
    check_file,
    checked,
    did_you_mean,
    located,
    part_of,
    reading,
)
from patchlaw.support.readable import Displayed, Table

MOST_BYTES = 64 * 1024
"""Size of the largest scene file [B]; a scene with every key takes 2 kB."""

_START = 4096  # bytes that tell a scene from heights
_DEEPEST = 100  # sections within sections
_EXCLUSIVE = {
    "approach": ("force", "pressure", "stage"),
    "force": ("approach", "pressure", "stage"),
    "pressure": ("approach", "force", "stage"),
    "file": ("spectrum", "heights"),
    "spectrum": ("file", "heights"),
    "heights": ("file", "spectrum"),
}
"""Keys that one key replaces, as a section may have only one of them."""
_HALF_SPACE = "micro.model = 'half-space', on a coarser surface.grid where speed matters"
_AUTO = "coupling.kind", "patches.grid", "block.cells", "surface.grid", "counter_surface.grid"
_BY_ACCURACY = "leave it out, with 'accuracy' beside it, which chooses what is not stated"
_EDGES = "reference.fine states the edge length of tetrahedra"
GONE: Mapping[str, str] = {
    "micro.model = 'islands'": _HALF_SPACE,
    "micro.model = 'auto'": _HALF_SPACE,
    "micro.curvature": f"leave it out, for that of the summit; or {_HALF_SPACE}",
    "micro.border": f"leave it out: summits on the border carry no load; or {_HALF_SPACE}",
    **{f"{key} = 'auto'": _BY_ACCURACY for key in _AUTO},
    "coupling.compliance": "leave it out: the program chooses",
    "coupling.newton": "leave it out: the program chooses",
    "micro.solver": "leave it out: Newton's method on the active set",
    "micro.tolerance": f"leave it out; or {_HALF_SPACE}",
    "reference.mesh": f"leave it out: all meshes are of tetrahedra; {_EDGES}",
    "reference.cells": f"{_EDGES}, or leave it out",
    "reference.mesher": "leave it out; a mesh of your own, by gmsh too, goes into [body]",
}
"""What to do instead, by key, or by key and value where other values stay."""


def read_scene_file(path: Path) -> dict[str, Any]:
    """Return what a scene file says, unchecked.

    Args:
        path: TOML file in UTF-8.

    Raises:
        InputError: When it is no regular file, cannot be read, is too large or no TOML.
    """
    check_file(path, str(path))
    with reading(path, str(path)), path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if path.suffix.lower() != ".toml" and _may_be_heights(content):
        raise InputError(
            f"is no scene, it looks like a height map: 'patchlaw init {path}' writes one for it",
            file=str(path),
        )
    if len(content) > MOST_BYTES:
        allowed = f"{MOST_BYTES} bytes"
        problem = "cannot be read: it is larger than any scene"
        raise InputError(problem, allowed=allowed, file=str(path))
    try:
        return parsed(content.decode("utf-8-sig"))  # some editors put a mark before the text
    except UnicodeDecodeError as error:
        problem = f"is not UTF-8 text: {error}"
    except ValueError as error:
        problem = f"is not valid TOML: {error}"
    raise InputError(problem, file=str(path))


def _may_be_heights(content: bytes) -> bool:
    """Tell whether bytes are no text, or have no line that sets a key or begins a section."""
    try:
        text = content[:_START].decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return error.start < len(content[:_START]) - 4  # the last character may be cut
    lines = [line for line in map(str.strip, text.splitlines()) if line and line[0] != "#"]
    return "\0" in text or (bool(lines) and not any("=" in one or one[0] == "[" for one in lines))


def overridden(data: dict[str, Any], text: str) -> dict[str, Any]:
    """Return what a scene file says, with one key set from the command line.

    Args:
        data: The sections; they stay what they are.
        text: ``key=value``; a value is TOML, or else a plain string.

    Raises:
        InputError: When it is no override, or a section in its key is none.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key or key.count(".") >= _DEEPEST:
        raise InputError("is not an override", value=text, allowed="--set key=value")
    return changed(data, key, _overriding(value))


def changed(data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """Return nested dictionaries with one key set, without the keys that it excludes.

    Args:
        data: The dictionaries; they stay what they are.
        key: The dotted key.
        value: Its value.

    Raises:
        InputError: When a section in the key is none.
    """
    first, _, rest = key.partition(".")
    if not rest:
        excluded = _EXCLUSIVE.get(first, ())
        return {name: old for name, old in data.items() if name not in excluded} | {first: value}
    section = data.get(first, {})
    if not isinstance(section, dict):
        raise InputError(f"'{first}' is not a section", key=key, value=value)
    return data | {first: changed(section, rest, value)}


def _overriding(text: str) -> Any:
    try:
        stated = parsed(f"value = {text}")
    except ValueError:
        return text
    return stated["value"] if stated.keys() == {"value"} else text


def parsed(text: str) -> dict[str, Any]:
    """Return a TOML text as nested dictionaries.

    Args:
        text: The text.

    Raises:
        ValueError: When it is no TOML, or nested deeper than anything sensible.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def refuse_removed(scene: Any) -> None:
    """Refuse a scene that names what is gone.

    Args:
        scene: The sections as nested dictionaries, unchecked.

    Raises:
        InputError: When it does; says what to write instead.
    """
    for name, section in scene.items() if isinstance(scene, Mapping) else ():
        for field_name, value in section.items() if isinstance(section, Mapping) else ():
            key = f"{name}.{field_name}"
            if instead := GONE.get(key) or GONE.get(f"{key} = {value!r}"):
                raise InputError("is gone", key=key, value=value, allowed=instead)


VERSION = "version of patchlaw"
CONTENT = "content of "
_DRAWN = ("output.figures", "output.report", "output.fields")

Change = tuple[str, Any, Any]
"""A key, with its present and its former value."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Scene(Displayed, SceneSections):
    """A complete scene: its sections, and the file that it was read from.

    Printed, or in a notebook, it shows the keys that were written.

    Args:
        source: The file; None for a scene from Python.
        written: What was written, as nested dictionaries, before units were read.
        decision: What `resolve` measured for the keys that it chose; None of other scenes.
    """

    HOW: ClassVar[str] = "Scene.load(path) or Scene.from_dict(sections)"
    """How users make one, for errors."""

    source: Path | None = field(default=None, metadata={KEY: None})
    written: dict[str, Any] = field(default_factory=dict, compare=False, metadata={KEY: None})
    decision: Any = field(default=None, compare=False, metadata={KEY: None})

    @classmethod
    @checked
    def load(cls, path: str | Path, overrides: Sequence[str] = ()) -> Scene:
        """Read and check a scene file.

        Args:
            path: TOML file.
            overrides: ``key=value`` strings with dotted keys; a value is TOML, or else a plain
                string (``load.approach=4 um``).

        Raises:
            InputError: When the file cannot be read or anything in it is wrong.
        """
        path = Path(path)
        data = read_scene_file(path)
        for text in overrides:
            data = overridden(data, text)
        return cls.from_dict(data, source=path)

    @classmethod
    @checked
    def from_dict(cls, data: dict[str, Any], source: Path | None = None) -> Scene:
        """Check a scene given as nested dictionaries.

        Args:
            data: The sections, as in a scene file.
            source: The file they came from: named in errors; relative paths start in its folder.

        Raises:
            InputError: When anything is wrong; names file, key, value and what is allowed.
        """
        with located(str(source) if source else None):
            try:
                data = _copied(data)
                refuse_removed(data)
            except RecursionError:
                raise InputError("is nested too deeply, or within itself") from None
            sections = read(SceneSections, data, _unknown_key)
            scene = cls(**part_of(sections, SceneSections), source=source, written=data)
            check_together(scene, scene.stated("coupling"))
        return scene

    @checked
    def to_dict(self, *, whole: bool = True) -> dict[str, Any]:
        """Return all sections as nested dictionaries that JSON can hold, as `from_dict` takes them.

        Heights in memory are named by their digest.

        Args:
            whole: Whether keys without a value are among them, as None.
        """
        return to_dict(self, whole=whole)

    @checked
    def with_(self, changes: Mapping[str, Any]) -> Scene:
        """Return a scene that differs in some keys from what was written.

        A key that excludes another replaces it: ``load.force`` replaces ``load.approach``.

        Args:
            changes: Values as in a scene file, by dotted key, as ``{"block.young_modulus": "70
                GPa"}``.

        Raises:
            InputError: When a key is none, or the scene would be wrong.
        """
        data = self.written
        for key, value in changes.items():
            data = changed(data, key, value)
        return Scene.from_dict(data, self.source)

    def displayed(self) -> tuple[str, Table]:
        """Return where the scene is from in a line, and a table of the keys that were written."""
        rows = [(key, _said(value)) for key, value in flat(self.written)]
        return f"Scene {self.file or 'from Python'}", (("key", "value"), rows)

    def stated(self, section: str) -> set[str]:
        """Return the keys that were written of a section.

        Args:
            section: Its name.
        """
        return set(self.written.get(section) or ())

    @property
    def open_keys(self) -> frozenset[str]:
        """The keys that an accuracy chooses, which are not stated beside it.

        The block's cells are one of them only under laws on its mesh, the grid of the surface only
        where it is a spectrum's, the degree of displacements only under laws of samples.
        """
        if self.accuracy is None:
            return frozenset()
        by_samples = self.law.representative
        keys = ["micro.finite_slopes"] if by_samples else ["coupling.kind", "patches.grid"]
        if self.block is not None and self.on_mesh:
            keys += ["block.cells"] + ["block.element"] * by_samples
        for name in ("body", "counter_body") if self.has_body else ():
            if getattr(getattr(self, name), "mesh", None):
                keys += [f"{name}.refinements"] + [f"{name}.element"] * by_samples
        found = {key for key in keys if key.split(".")[1] not in self.stated(key.split(".")[0])}
        if self.surface.lacks_grid:
            found.add("surface.grid")
        # other keys of a micro model belong to one that is stated
        if not (by_samples or self.stated("micro")):
            found.add("micro.model")
        if self.meshes_roughness and self.reference.fine is None:
            found.add("reference.fine")
        return frozenset(found)

    def check_has_laws(self) -> None:
        """Refuse a coupling without laws.

        Raises:
            InputError: When the coupling has no laws.
        """
        if not self.by_laws:
            allowed = "isolated, consistent"
            problem, key = "has no laws", "coupling.kind"
            raise InputError(problem, key=key, value=self.kind, allowed=allowed, file=self.file)

    @property
    def name(self) -> str:
        """Name of the scene: its file's stem."""
        return self.source.stem if self.source else "scene"

    @property
    def file(self) -> str | None:
        """The file the scene was read from."""
        return str(self.source) if self.source else None

    def files(self) -> dict[str, Path]:
        """Return the paths of all files that the scene names, by dotted key."""
        surfaces = {"surface": self.surface, "counter_surface": self.counter_surface}
        surfaces |= {f"law.regions.{n}": one for n, one in enumerate(self.law.regions)}
        meshes = {"body": self.body, "counter_body": self.counter_body}
        named = {f"{key}.file": one.file for key, one in surfaces.items() if one}
        named |= {f"{key}.mesh": one.mesh for key, one in meshes.items() if one}
        named |= {f"law.samples.{n}": file for n, file in enumerate(self.law.samples)}
        return {key: path for key, name in named.items() if (path := self.path_of(name))}

    def path_of(self, file: str | None) -> Path | None:
        """Return the path of a file that the scene names; relative ones start in its folder.

        Args:
            file: The name, or None.
        """
        if file is None:
            return None
        return (self.source.parent if self.source else Path()) / file


def _copied(data: Any) -> Any:
    """Return nested dictionaries that do not change with those that were given.

    Arrays and numbers of numpy become those of Python, but for heights.
    """
    if isinstance(data, dict):
        pairs = data.items()
        return {name: (_unchanging if name == "heights" else _copied)(one) for name, one in pairs}
    if isinstance(data, list | tuple):
        return [_copied(value) for value in data]
    return data.tolist() if isinstance(data, np.generic | np.ndarray) else data


def _unchanging(heights: Any) -> Any:
    """Return a copy of heights, or themselves where nobody writes them, as where they are one."""
    if isinstance(heights, np.ndarray) and not heights.flags.writeable:
        return heights
    copied = deepcopy(heights)
    if isinstance(copied, np.ndarray):
        copied.setflags(write=False)
    return copied


def _said(value: Any) -> str:
    """Return a value as a table shows it; of an array its shape."""
    if (shape := getattr(value, "shape", ())) != ():
        return f"{' × '.join(map(str, shape))} numbers"
    return str(value)


def _unknown_key(path: list[str]) -> InputError:
    """Return the error on a key that a section does not have; a very near one may be elsewhere."""
    known = keys_beside(path)
    tries = ((known, 0.7), (scene_keys(), 0.7), (known, 0.5))
    hints = (did_you_mean(path[-1], names, cutoff=cutoff) for names, cutoff in tries)
    hint = next(filter(None, hints), "")
    return InputError(f"unknown key{hint}", key=".".join(path) or '""', allowed=", ".join(known))


def identity(scene: Scene) -> dict[str, Any]:
    """Return all that the numbers of a scene depend on, as one dictionary that JSON can hold.

    Args:
        scene: The scene; what it wants drawn is left out.
    """

    def digest(key: str, path: Path) -> str:
        with located(key=key):
            return content_digest(path)[:20]

    digests = {key: digest(key, path) for key, path in scene.files().items()}
    return flat_identity(scene.to_dict(), digests, version("patchlaw"))


def flat_identity(
    sections: Mapping[str, Any], files: Mapping[str, str], release: str
) -> dict[str, Any]:
    """Return the identity of a scene that was written down, see `identity`.

    Args:
        sections: The sections of the scene, as JSON holds them.
        files: What stood for the content of the files that it names, by dotted key.
        release: Version of patchlaw.
    """
    keys = {key: value for key, value in flat(sections) if key not in _DRAWN}
    return keys | {CONTENT + key: each for key, each in files.items()} | {VERSION: release}


def changes(now: Mapping[str, Any], then: Mapping[str, Any]) -> Iterator[Change]:
    """Yield what differs between two identities.

    Args:
        now: The present one.
        then: The former one.
    """
    for key in dict.fromkeys((*now, *then)):
        if now.get(key) != then.get(key):
            yield key, now.get(key), then.get(key)


def told(differing: list[Change]) -> str:
    """Return the first changes as the end of a sentence that begins with "where"."""
    shown = ", ".join(f"{key} was {old!r}" for key, _, old in differing[:3])
    return shown + f" and {len(differing) - 3} more" * (len(differing) > 3)


def content_digest(path: Path) -> str:
    """Return the SHA-256 of a file and, of XDMF, the files of its arrays; empty without the file.

    Args:
        path: The file.

    Raises:
        InputError: When it cannot be read.
    """
    with reading(path):
        if not path.is_file():
            return ""
        whole = _sha256(path)
        for arrays in arrays_of(path):
            whole.update(_sha256(arrays).digest() if arrays.is_file() else b"none")
    return whole.hexdigest()


def arrays_of(path: Path) -> list[Path]:
    """Return the HDF5 files of the arrays of an XDMF file, sorted by name; none of other files.

    They are those that it names, and that of its own name, which dolfinx reads whatever it says.

    Args:
        path: The file, which need not be one that can be read.
    """
    if path.suffix.lower() != ".xdmf":
        return []
    from xml.etree import ElementTree  # others do without

    names = {path.with_suffix(".h5").name}
    with suppress(OSError, ElementTree.ParseError):
        for item in ElementTree.parse(path).iter("DataItem"):
            name, inside, _ = (item.text or "").strip().rpartition(":")
            names |= {name} if inside else set()
    return [path.parent / name for name in sorted(names)]


def read_files(scene: Scene) -> list[Path]:
    """Return all files that a scene is read from: its own, those that it names, their arrays.

    Args:
        scene: The scene.
    """
    named = [*scene.files().values(), *filter(None, [scene.source])]
    return named + [arrays for path in named for arrays in arrays_of(path)]


def _sha256(path: Path) -> Any:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256")
