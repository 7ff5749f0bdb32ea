"""Writes a scene file with comments, for a surface of the user's own or a synthesised one."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from geometry.materials import Material
from geometry.statistics import roughness
from geometry.surface import Surface
from multiscale.readable import quantity
from multiscale.scene.keys import scene_keys

CONTACT_AREA = 0.02
"""Contact area fraction that the default force makes, roughly."""

_WIDTH = 96

START: Mapping[str, Any] = {
    "surface": {},
    "block": {"young_modulus": "210 GPa", "poisson_ratio": 0.3, "sides": "free"},
    "patches": {"grid": [4, 4]},
    "micro": {"model": "half-space"},
    "coupling": {"kind": "concurrent"},
    "load": {"steps": 8},
    "output": {"check": "last"},
}
"""What a new scene says unless its user says otherwise: steel, and contacts cell by cell."""

SYNTHESISED: Mapping[str, Any] = {
    "spectrum": {"hurst": 0.8, "waves": [4, 32], "rms_slope": 0.1, "seed": 1},
    "grid": [256, 256],
    "lengths": ["1 mm", "1 mm"],
}
"""The surface of a new scene without a file."""


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
    sides = " × ".join(quantity(side, "mm") for side in surface.lengths)
    return [
        f"{surface.source}.",
        f"{nx} × {ny} heights on {sides}; rms height {quantity(rough.sq, 'mm', 3)}, "
        f"rms gradient {rough.sdq:.3g}.",
        *(f"Note: {note}." for note in surface.notes),
    ]


def scene_text(data: Mapping[str, Mapping[str, Any]], remarks: Iterable[str]) -> str:
    """Return a scene file in which a comment explains every key.

    Args:
        data: The sections with their keys.
        remarks: Sentences for its head.
    """
    keys, order = scene_keys(), list(scene_keys())
    head = "\n#\n".join(_comment(remark) for remark in remarks)
    parts = [head]
    for section, values in data.items():
        lines = [_comment(keys[section].meaning), f"[{section}]"]
        for key, value in sorted(
            values.items(), key=lambda one: order.index(f"{section}.{one[0]}")
        ):
            lines += [_comment(keys[f"{section}.{key}"].meaning), f"{key} = {_toml(value)}"]
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _comment(text: str) -> str:
    lines = textwrap.wrap(text, _WIDTH, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)


def _toml(value: Any) -> str:
    """Return a value as TOML has it; its strings are those of JSON."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_toml(one)}' for key, one in value.items())} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(_toml(one) for one in value)}]"
    return json.dumps(value, ensure_ascii=False)
