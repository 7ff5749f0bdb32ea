"""The scene: everything a run needs to know, checked before anything runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_origin

from pydantic import BaseModel, ValidationError

from multiscale.removed import refuse_removed
from multiscale.scene.contents import SceneSections
from multiscale.scene.keys import scene_keys
from multiscale.scene.scene_file import changed, overridden, read_scene_file
from multiscale.scene.sections import NAMES_A_FILE, Section
from support.errors import InputError, did_you_mean

_OF_TYPES = ("str", "int", "constrained-int", "float", "constrained-float")
"""Names of types that stand at the end of a key's place where it may have several."""


@dataclass(frozen=True, slots=True)
class Written:
    """What was written of a scene, which takes no part when scenes are compared.

    Args:
        data: The sections, before units were read.
    """

    data: dict[str, Any] = field(default_factory=dict, compare=False)


class Scene(SceneSections):
    """A complete scene: its sections, and the file that it was read from."""

    _source: Path | None = None
    _written: Written = Written()

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
            refuse_removed(data)
            scene = cls.model_validate(data)
        except InputError as error:
            raise error.located(file=str(source) if source else None) from None
        except ValidationError as error:
            raise _first_problem(error, cls).located(file=str(source) if source else None) from None
        scene._source, scene._written = source, Written(data)
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
        data, written = self.model_dump(by_alias=True, exclude_unset=True), self.written
        for key, value in changes.items():
            data, written = changed(data, key, value), changed(written, key, value)
        scene = Scene.from_dict(data, self._source)
        scene._written = Written(written)
        return scene

    @property
    def written(self) -> dict[str, Any]:
        """What was written, as nested dictionaries, before units were read."""
        return self._written.data

    @property
    def name(self) -> str:
        """Name of the scene: its file's stem."""
        return self._source.stem if self._source else "scene"

    @property
    def file(self) -> str | None:
        """The file the scene was read from."""
        return str(self._source) if self._source else None

    def files(self) -> dict[str, Path]:
        """Return the paths of all files that the scene names, by dotted key."""
        named = dict(_named_files(self, ""))
        return {key: path for key, name in named.items() if (path := self.path_of(name))}

    @property
    def surface_path(self) -> Path | None:
        """Path of the heights, relative paths taken from the scene's folder."""
        return self.path_of(self.surface.file)

    def path_of(self, file: str | None) -> Path | None:
        """Return the path of a file that the scene names; relative ones start in its folder.

        Args:
            file: The name, or None.
        """
        if file is None:
            return None
        return (self._source.parent if self._source else Path()) / file


def _named_files(value: Any, place: str) -> Iterator[tuple[str, str | None]]:
    """Yield dotted keys below a value of a scene that name files, with what they name."""
    if isinstance(value, Section):
        for name, field in type(value).model_fields.items():
            key = f"{place}{field.alias or name}"
            if NAMES_A_FILE in field.metadata:
                yield key, getattr(value, name)
            else:
                yield from _named_files(getattr(value, name), f"{key}.")
    elif isinstance(value, tuple):
        for number, one in enumerate(value):
            yield from _named_files(one, f"{place}{number}.")


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
    if path and path[-1] in _OF_TYPES:
        path.pop()
    key = ".".join(part for part in path if "[" not in part and part != "bool") or None
    key = key or problem.get("ctx", {}).get("key")
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
    """Return the error on a key that a section does not have; a very near one may be elsewhere."""
    known = _known_keys(model, path[:-1])
    tries = ((known, 0.7), (scene_keys(), 0.7), (known, 0.5))
    hints = (did_you_mean(path[-1], names, cutoff=cutoff) for names, cutoff in tries)
    hint = next(filter(None, hints), "")
    return InputError(f"unknown key{hint}", key=".".join(path) or '""', allowed=", ".join(known))


def _known_keys(model: Any, sections: list[str]) -> list[str]:
    """Return the keys of the section that a path leads to."""
    several = False
    for section in sections:
        if several:  # the number or the name of one of several
            several = False
            continue
        fields = {field.alias or name: field for name, field in model.model_fields.items()}
        annotation = fields[section].annotation
        several = get_origin(annotation) in (tuple, dict)
        options = getattr(annotation, "__args__", (annotation,))
        model = next(option for option in options if hasattr(option, "model_fields"))
    return [field.alias or name for name, field in model.model_fields.items()]
