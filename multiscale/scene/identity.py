"""What the numbers of a scene depend on: its keys, the content of the files it names, the version.

Results that were stored go on, or stand for a scene, only where nothing of this has changed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from multiscale.scene.scene import Scene
from multiscale.scene.scene_file import flat

VERSION = "version of patchlaw"
CONTENT = "content of "
_DRAWN = ("output.figures", "output.report", "output.fields")

_ARRAYS = re.compile(rb"[^\s<>\"':]+\.h5(?=:)")
"""Names of HDF5 files in an XDMF file, relative to its folder."""

Change = tuple[str, Any, Any]
"""A key, with its present and its former value."""


def identity(scene: Scene) -> dict[str, Any]:
    """Return all that the numbers of a scene depend on, as one dictionary that JSON can hold.

    Args:
        scene: The scene; what it wants drawn is left out.
    """
    digests = {key: content_digest(path)[:20] for key, path in scene.files().items()}
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


def files_of(identity: Mapping[str, Any]) -> dict[str, str]:
    """Return what stands for the content of files in an identity, by the keys that name them."""
    return {
        key.removeprefix(CONTENT): each for key, each in identity.items() if key.startswith(CONTENT)
    }


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
    """
    if not path.is_file():
        return ""
    whole = _sha256(path)
    if path.suffix.lower() == ".xdmf":
        for name in sorted(set(_ARRAYS.findall(path.read_bytes()))):
            arrays = path.parent / name.decode(errors="replace")
            whole.update(_sha256(arrays).digest() if arrays.is_file() else b"none")
    return whole.hexdigest()


def _sha256(path: Path) -> Any:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256")
