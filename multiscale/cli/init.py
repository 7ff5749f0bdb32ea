"""The command ``patchlaw init``: a scene with comments, for a measured surface or a spectrum."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from shlex import quote
from shutil import which
from typing import Any

from patchlaw.geometry import Material, Surface, roughness
from patchlaw.multiscale import console
from patchlaw.multiscale.machine import refuse_detached_processes
from patchlaw.multiscale.scene.parts import block_section
from patchlaw.multiscale.scene.scene import Scene, changed, overridden
from patchlaw.multiscale.scene.schema import scene_keys
from patchlaw.multiscale.scene.surfaces import make_surface
from patchlaw.support import InputError, check_file, on_root
from patchlaw.support.files import write_text
from patchlaw.support.readable import printable, quantities, quantity

CONTACT_AREA = 0.02
"""Contact area fraction that the default force makes, roughly."""

START: Mapping[str, Any] = {
    "surface": {},
    "block": {"young_modulus": "210 GPa", "poisson_ratio": 0.3, "sides": "free"},
    "patches": {"grid": [4, 4]},
    "micro": {"model": "half-space", "hardness": "2.5 GPa"},
    "coupling": {"kind": "concurrent"},
    "load": {"steps": 8},
    "output": {"check": "last"},
}
"""What a new scene says unless its user says otherwise: steel of 255 HV, contacts cell by cell."""

SYNTHESISED: Mapping[str, Any] = {
    "spectrum": {"hurst": 0.8, "waves": [4, 32], "rms_slope": 0.1, "seed": 1},
    "grid": [256, 256],
    "lengths": ["1 mm", "1 mm"],
}
"""The surface of a new scene without a file."""

UNUSED: Mapping[str, Any] = {
    "surface": {"filter": {"short": "8 um"}},
    "micro": {"hardness": "2.5 GPa"},
    "load": {"tilt": "free"},
    "output": {"contact": "all", "fields": "last"},
    "conductance": {"conductivity": ["50 W/m/K"]},
}
"""Keys that a new scene has as comments, unless it uses them, with values to start from."""

_KEYS = {
    "force": "load.force",
    "approach": "load.approach",
    "young_modulus": "block.young_modulus",
    "poisson_ratio": "block.poisson_ratio",
    "height_unit": "surface.height_unit",
    "xy_unit": "surface.xy_unit",
    "channel": "surface.channel",
    "lengths": "surface.lengths",
    "swap_xy": "surface.swap_xy",
}
"""Keys of a scene that words of the command line set."""


def write_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Write a scene that runs at once, with comments that explain it.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    refuse_detached_processes()
    path, remarks = on_root(comm, lambda: _write(choice))
    for remark in remarks:
        console.say(comm, remark)
    console.say(comm, f"wrote {path}; to run it: {_command()} run {quote(str(path))}")


def _command() -> str:
    """Return how patchlaw is called in this shell: by its name, or else as it was now."""
    called = sys.argv[0]
    return called if Path(called).name == "patchlaw" and not which("patchlaw") else "patchlaw"


def _write(choice: argparse.Namespace) -> tuple[Path, list[str]]:
    """Write the scene; return its path, and what was found and chosen."""
    if choice.surface and choice.surface.suffix == ".toml":
        raise InputError(
            "is a scene, not a surface",
            key="SURFACE",
            value=str(choice.surface),
            allowed="a measured map; the scene to write is --out",
        )
    if choice.surface:
        check_file(choice.surface, str(choice.surface))
    path = choice.out or Path(choice.surface.stem if choice.surface else "scene").with_suffix(
        ".toml"
    )
    if choice.surface and path.exists() and path.samefile(choice.surface):
        raise InputError("is the surface", key="--out", value=str(path), allowed="another file")
    if os.path.lexists(path) and not choice.overwrite:
        raise InputError(
            "exists already", key="--out", value=str(path), allowed="another file, or --overwrite"
        )
    loaded = choice.force is not None or choice.approach is not None
    scene, surface, remarks = _with_surface(_given(choice), loaded)
    height = quantity(block_section(scene).height_under(surface.lengths), "mm", digits=6)
    scene = scene.with_({"block.height": height.replace("µ", "u")})
    if not loaded:
        force = sensible_force(surface, block_section(scene).material)
        scene = scene.with_({"load.force": force})
        remarks.append(
            f"The force of {force} is a start: about {100 * CONTACT_AREA:g} % of the surface will "
            "touch."
        )
    if choice.young_modulus is None:
        remarks.append(
            "The block is of steel of 255 HV: write your constants in the sections block and micro."
        )
    about = (
        f"Made by patchlaw init. To run it: patchlaw run {path}; on a key: patchlaw help KEY. What "
        "is not used stands as a comment: remove the sign # before its key."
    )
    data = scene.written
    if choice.surface is not None:  # relative paths start in the folder of the scene
        data = changed(data, "surface.file", os.path.relpath(choice.surface, path.parent))
    write_text(path, scene_text(data, [about, *remarks]))
    return path, remarks


def _given(choice: argparse.Namespace) -> dict[str, Any]:
    """Return the sections of the new scene, as far as the command line says them."""
    source: dict[str, Any] = dict(SYNTHESISED)
    if choice.surface is not None:
        source = {"file": str(choice.surface), "detrend": "plane"}
    data: dict[str, Any] = {**START, "surface": source}
    if choice.young_modulus is not None:  # which hardness goes with it is not known
        data["micro"] = {"model": "half-space"}
    for word, key in _KEYS.items():
        value = getattr(choice, word)
        if isinstance(value, str):
            data = overridden(data, f"{key}={value}")
        elif value:
            data = changed(data, key, value if value is True else [*map(_number_or_text, value)])
    return data


def _number_or_text(text: str) -> float | str:
    """Return a length without a unit as the number of mm that it is in scenes."""
    try:
        return float(text)
    except ValueError:
        return text


def _with_surface(data: dict[str, Any], loaded: bool) -> tuple[Scene, Surface, list[str]]:
    """Return the scene with what its map needs done, its surface, and what was found.

    A scene without a load gets one that stands for that to come.
    """
    scene = Scene.from_dict(data if loaded else changed(data, "load.force", "1 N"))
    if scene.surface.file is None:
        surface = make_surface(scene)
        return scene, surface, findings(surface)
    scene, remarks = _readable(scene)
    raw = make_surface(scene.with_({"surface.detrend": "none"}))
    surface = make_surface(scene)
    if any("spike" in note for note in surface.notes):
        scene = scene.with_({"surface.outliers": "remove"})
        surface = make_surface(scene)
    remarks += [f"As it was: {note}." for note in raw.notes if note not in surface.notes]
    return scene, surface, [*findings(surface), *remarks]


def _readable(scene: Scene) -> tuple[Scene, list[str]]:
    """Return the scene with gaps filled and spikes removed where its map needs that to be read.

    Raises:
        InputError: What is wrong with the map as it is.
    """
    fill, remove = {"surface.missing": "fill"}, {"surface.outliers": "remove"}
    for changes in ({}, fill, remove, fill | remove):
        tried = scene.with_(changes)
        try:
            make_surface(tried.with_({"surface.detrend": "none"}))
        except InputError as error:
            problem = error
            continue
        remark = "Heights are missing: missing = 'fill' closes the gaps by a membrane."
        return tried, [remark] if "surface.missing" in changes else []
    raise _in_words(problem)


def _in_words(error: InputError) -> InputError:
    """Return an error on keys of a scene with the words of this command that set them."""
    problem = _as_words(error.problem)
    if "no sides in a unit" not in problem:
        return InputError(problem, allowed=error.allowed, key=error.key, file=error.file)
    allowed = "--lengths LX LY, such as --lengths '2 mm' '1 mm'; --height-unit UNIT, if not mm"
    return InputError(problem, allowed=allowed, file=error.file)


def _as_words(text: str) -> str:
    units = re.sub(r"(height|xy)_unit = '(\w+)'", r"--\1-unit \2", text)
    return units.replace("swap_xy = true", "--swap-xy")


def sensible_force(surface: Surface, material: Material) -> str:
    """Return the force, to one digit, under which about a fiftieth of a surface touches.

    Args:
        surface: The surface.
        material: The material of the block.

    Source:
        Persson 2001, doi 10.1063/1.1388626: at light loads the contact area fraction is
        κ p / (E* h'), h' the rms gradient, with κ = √(8/π).
    """
    mean_pressure = CONTACT_AREA * material.contact_modulus * roughness(surface).sdq / 1.6
    force = mean_pressure * surface.area or 1.0  # any does on a level surface
    return quantity(force, "N", digits=1).replace("µ", "u")


def findings(surface: Surface) -> list[str]:
    """Return sentences on what a surface is: grid, sides, roughness, notes.

    Args:
        surface: The surface.
    """
    rough, (nx, ny) = roughness(surface), surface.grid
    sides = " × ".join(quantities(surface.lengths, "mm"))
    return [
        f"{surface.source}.",
        f"{nx} × {ny} heights on {sides}; rms height {quantity(rough.sq, 'mm', 3)}, "
        f"rms gradient {rough.sdq:.3g}.",
        *(f"Note: {_as_words(note)}." for note in surface.notes),
    ]


def scene_text(data: Mapping[str, Mapping[str, Any]], remarks: Iterable[str]) -> str:
    """Return a scene file in which a comment explains every key, and those of `UNUSED` as comments.

    Args:
        data: The sections with their keys.
        remarks: Sentences for its head.
    """
    keys, order = scene_keys(), list(scene_keys())
    head = "\n#\n".join(_comment(remark) for remark in remarks)
    parts = [head]
    for section in dict.fromkeys([*data, *UNUSED]):
        used, mark = data.get(section, {}), "" if section in data else "# "
        lines = [_comment(keys[section].meaning), f"{mark}[{section}]"]
        for key, value in sorted(
            (UNUSED.get(section, {}) | used).items(),
            key=lambda one: order.index(f"{section}.{one[0]}"),
        ):
            mark = "" if key in used else "# "
            lines += [_comment(keys[f"{section}.{key}"].meaning), f"{mark}{key} = {_toml(value)}"]
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _comment(text: str) -> str:
    lines = textwrap.wrap(printable(text), 96, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)


def _toml(value: Any) -> str:
    """Return a value as TOML has it; its strings are those of JSON."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_toml(one)}' for key, one in value.items())} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(_toml(one) for one in value)}]"
    if isinstance(value, str) and re.search("[\ud800-\udfff]", value):
        allowed = "a name in UTF-8, which scene files have"
        raise InputError("is no name that a scene can hold", value=value, allowed=allowed)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
