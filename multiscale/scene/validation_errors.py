"""Turns what pydantic finds wrong in a scene into one clear error."""

from __future__ import annotations

import difflib
from typing import Any

from pydantic import BaseModel, ValidationError

from geometry.errors import InputError


def first_refusal(error: ValidationError, model: type[BaseModel]) -> InputError:
    """Return the first problem as an `InputError` with key, value and what is allowed.

    Args:
        error: What pydantic raised.
        model: The model that was being filled; gives the known keys.
    """
    problems = error.errors(include_url=False)
    # A misspelt key also leaves its true name missing: the misspelling is what to say.
    problems.sort(key=lambda problem: problem["type"] != "extra_forbidden")
    problem = problems[0]
    path = [str(part) for part in problem["loc"]]
    if problem["type"] == "extra_forbidden":
        return _unknown_key(path, model)
    key = ".".join(path) or None
    if problem["type"] == "missing":
        return InputError("is required and missing", key=key)
    if problem["type"] == "model_type":
        return InputError("must be a section", key=key, value=problem["input"])
    text, _, allowed = problem["msg"].removeprefix("Value error, ").partition(" (allowed: ")
    text = text.replace("Input should be", "must be")
    if isinstance(problem["input"], dict):
        return InputError(text, key=key, allowed=allowed.rstrip(")") or None)
    return InputError(text, value=problem["input"], key=key, allowed=allowed.rstrip(")") or None)


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
