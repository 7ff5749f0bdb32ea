"""The scene: everything a run needs to know, read from TOML and checked before anything runs."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, Field, ValidationError, model_validator

from geometry.errors import InputError
from multiscale.scene.coupling_sections import CouplingSection, LoadSection, ReferenceSection
from multiscale.scene.sections import (
    BlockSection,
    MicroSection,
    Number,
    OutputSection,
    PatchesSection,
    Section,
    SurfaceSection,
)

MOST_BYTES = 64 * 1024
"""Size of the largest scene file [B]; a scene with every key takes 2 kB."""

_OF_NUMBER = re.compile(r"[0-9]\.[0-9]+(?!\.)")
_DEEPEST = 100  # sections within sections
_EXCLUSIVE = {
    "approach": ("force",),
    "force": ("approach",),
    "file": ("spectrum", "heights"),
    "spectrum": ("file", "heights"),
    "heights": ("file", "spectrum"),
}
"""Keys that one key replaces, as a section may have only one of them."""


class Scene(Section):
    """A complete scene. Lengths in mm, pressures in MPa.

    The section ``[load]`` is the attribute `loading`, because `Scene.load` reads a file.

    ``accuracy`` is the allowed relative error of the force. The keys ``surface.grid``,
    ``micro.model``, ``coupling.kind``, ``patches.grid`` and, under laws on a mesh, ``block.cells``
    may be ``"auto"``: they get the values that are predicted to keep the accuracy at the least
    cost. With an accuracy this holds also for those that are not stated. Without an accuracy,
    ``"auto"`` means 2 %.
    """

    accuracy: Annotated[Number, Field(gt=0, lt=0.5)] | None = None
    surface: SurfaceSection
    block: BlockSection
    patches: PatchesSection = PatchesSection()
    micro: MicroSection = MicroSection()
    coupling: CouplingSection = CouplingSection()
    reference: ReferenceSection = ReferenceSection()
    loading: Annotated[LoadSection, Field(alias="load")]
    output: OutputSection = OutputSection()
    _source: Path | None = None

    @model_validator(mode="after")
    def _continues_periodically(self) -> Self:
        """Refuse a periodic contact where something ends or turns."""
        kind, model, tilt = self.coupling.kind, self.micro.model, self.loading.tilt
        if self.surface.periodic and (
            kind != "analytic" or model != "half-space" or tilt != (0, 0)
        ):
            raise ValueError(
                "surface.periodic = true: a body or a plane that turns does not continue "
                "periodically (allowed: coupling.kind = 'analytic', micro.model = 'half-space', "
                "a level plane)"
            )
        return self

    @classmethod
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
    def from_dict(cls, data: dict[str, Any], source: Path | None = None) -> Scene:
        """Check a scene given as nested dictionaries.

        Args:
            data: The sections, as in a scene file.
            source: The file they came from: named in errors; relative paths start in its folder.

        Raises:
            InputError: When anything is wrong; names file, key, value and what is allowed.
        """
        try:
            scene = cls.model_validate(data)
        except ValidationError as error:
            raise _first_problem(error, cls).located(file=str(source) if source else None) from None
        scene._source = source
        return scene

    def with_(self, changes: Mapping[str, Any]) -> Scene:
        """Return a scene that differs in some keys.

        A key that excludes another replaces it: ``load.force`` replaces ``load.approach``.

        Args:
            changes: Values as in a scene file, by dotted key, as ``{"block.young_modulus": "70
                GPa"}``.

        Raises:
            InputError: When a key is none, or the scene would be wrong.
        """
        data = self.model_dump(by_alias=True, exclude_unset=True)
        for key, value in changes.items():
            data = changed(data, key, value)
        return Scene.from_dict(data, self._source)

    @property
    def name(self) -> str:
        """Name of the scene: its file's stem."""
        return self._source.stem if self._source else "scene"

    @property
    def file(self) -> str | None:
        """The file the scene was read from."""
        return str(self._source) if self._source else None

    @property
    def surface_path(self) -> Path | None:
        """Path of the heights, relative paths taken from the scene's folder."""
        if self.surface.file is None:
            return None
        folder = self._source.parent if self._source else Path()
        return folder / self.surface.file


def _first_problem(error: ValidationError, model: type[BaseModel]) -> InputError:
    """Return the first problem that pydantic found, with key, value and what is allowed.

    Args:
        error: What pydantic raised.
        model: The model that was being filled, which knows its keys.
    """
    problems = error.errors(include_url=False)
    # A misspelt key also leaves its true name missing: the misspelling is what to say.
    problems.sort(key=lambda problem: problem["type"] != "extra_forbidden")
    problem = problems[0]
    path = [str(part) for part in problem["loc"]]
    if problem["type"] == "extra_forbidden":
        return _unknown_key(path, model)
    # of a key with several types pydantic names the type, and has a problem for each
    key = ".".join(part for part in path if "[" not in part) or None
    if problem["type"] == "missing":
        return InputError("is required and missing", key=key)
    if problem["type"] == "model_type":
        return InputError("must be a section", key=key, value=problem["input"])
    text, _, allowed = problem["msg"].removeprefix("Value error, ").partition(" (allowed: ")
    text = text.replace("Input should be", "must be").replace("valid tuple", "list")
    for other in problems[1:]:
        if other["type"] == "literal_error" and other["input"] is problem["input"]:
            text += f", or {other['ctx']['expected']}"
    value = {} if isinstance(problem["input"], dict) else {"value": problem["input"]}
    return InputError(text, key=key, allowed=allowed.rstrip(")") or None, **value)


def _unknown_key(path: list[str], model: type[BaseModel]) -> InputError:
    known = _known_keys(model, path[:-1])
    close = difflib.get_close_matches(path[-1], known, n=1, cutoff=0.5)
    hint = f"; did you mean '{close[0]}'?" if close else ""
    return InputError(f"unknown key{hint}", key=".".join(path) or '""', allowed=", ".join(known))


def _known_keys(model: Any, sections: list[str]) -> list[str]:
    """Return the keys of the section that a path leads to."""
    for section in sections:
        fields = {field.alias or name: field for name, field in model.model_fields.items()}
        annotation = fields[section].annotation
        options = getattr(annotation, "__args__", (annotation,))
        model = next(option for option in options if hasattr(option, "model_fields"))
    return [field.alias or name for name, field in model.model_fields.items()]


def read_scene_file(path: Path) -> dict[str, Any]:
    """Return what a scene file says, unchecked.

    Args:
        path: TOML file in UTF-8.

    Raises:
        InputError: When it is no regular file, cannot be read, is too large or no TOML.
    """
    content = _content(path)
    try:
        return parsed(content.decode("utf-8-sig"))  # some editors put a mark before the text
    except UnicodeDecodeError as error:
        problem = f"is not UTF-8 text: {error}"
    except ValueError as error:
        problem = f"is not valid TOML: {error}"
    raise InputError(problem, file=str(path))


def _content(path: Path) -> bytes:
    """Return the bytes of a regular file, which has an end, if a scene can be that large."""
    try:
        if path.exists() and not path.is_file():
            raise ValueError("it is not a regular file")
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise ValueError(f"it is larger than any scene (allowed: {MOST_BYTES} bytes)")
    except (OSError, ValueError) as error:  # ValueError: also a zero byte in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=str(path)) from None
    return content


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
        found = parsed(f"value = {text}")
    except ValueError:
        return text
    return found["value"] if found.keys() == {"value"} else text


def parsed(text: str) -> dict[str, Any]:
    """Return a TOML text as nested dictionaries.

    Args:
        text: The text.

    Raises:
        ValueError: When it is no TOML, or nested deeper than anything sensible.
    """
    if any(_dots(line) > _DEEPEST for line in text.split("\n")):
        raise ValueError("a line with more dots than any scene has")  # they take hours to parse
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _dots(line: str) -> int:
    """Count the dots of a line that may part keys, not those of numbers or comments."""
    if line.lstrip().startswith("#"):
        return 0
    return line.count(".") - len(_OF_NUMBER.findall(line))
