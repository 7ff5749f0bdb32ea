"""Identity of a scene: its keys, the content of every file that it names, the version."""

import re

import numpy as np
import pytest

from patchlaw.multiscale import Scene
from patchlaw.multiscale.scene import scene as module
from patchlaw.multiscale.scene.scene import changes, content_digest, identity, told
from patchlaw.multiscale.scene.schema import scene_keys

SURFACE = {"file": "scan.npy", "lengths": [1.0, 1.0]}
BODY = {
    "mesh": "part.msh", "contact": "top", "supports": [{"surface": "bottom"}],
    "young_modulus": 4e3, "poisson_ratio": 0.3,
}  # fmt: skip
RIM = {"surface": "rim", **SURFACE, "file": "rim.npy"}
LAW = {"kind": "representative", "samples": ["second.npy"], "regions": [RIM]}
DATA = {
    "surface": SURFACE, "counter_surface": {**SURFACE, "file": "other.npy"}, "body": BODY,
    "counter_body": {**BODY, "mesh": "plate.xdmf"}, "law": LAW, "load": {"force": 1.0},
}  # fmt: skip
KEYS = {
    "surface.file": "scan.npy", "counter_surface.file": "other.npy", "body.mesh": "part.msh",
    "counter_body.mesh": "plate.xdmf", "law.regions.0.file": "rim.npy",
    "law.samples.0": "second.npy",
}  # fmt: skip

ARRAYS = {
    "numbers.h5": "numbers.h5", "two words.h5": " two words.h5", "nuts & bolts.h5":
    "nuts &amp; bolts.h5", "it's.h5": "it's.h5", "50%20.h5": "50%20.h5",
}  # fmt: skip
"""Files that an XDMF file names, and how."""


@pytest.fixture
def folder(tmp_path):
    for name in KEYS.values():
        (tmp_path / name).write_bytes(name.encode())
    for name, text in ARRAYS.items():
        (tmp_path / name).write_bytes(b"1 2 3")
        xml = "".join(f"<DataItem>{text}:/mesh/x</DataItem>" for text in ARRAYS.values())
    (tmp_path / "plate.xdmf").write_text(f"<Xdmf>{xml}</Xdmf>")
    (tmp_path / "plate.h5").write_bytes(b"1 2 3")  # which dolfinx reads, whatever is named
    return tmp_path


def scene(folder):
    return Scene.from_dict(DATA, source=folder / "scene.toml")


def test_every_file_counts_by_its_content(folder):
    before = identity(scene(folder))
    for key, name in KEYS.items():
        path, content = folder / name, (folder / name).read_bytes()
        path.write_bytes(content + b"!")
        assert [change[0] for change in changes(identity(scene(folder)), before)] == [
            f"content of {key}"
        ]
        path.write_bytes(content)
    assert identity(scene(folder)) == before
    for name in (*ARRAYS, "plate.h5"):
        (folder / name).write_bytes(b"1 2 4")
        assert [change[0] for change in changes(identity(scene(folder)), before)] == [
            "content of counter_body.mesh"
        ]
        (folder / name).write_bytes(b"1 2 3")
    assert identity(scene(folder)) == before
    assert content_digest(folder / "nothing") == ""


def test_keys_and_version_count_and_what_is_drawn_does_not(folder, monkeypatch):
    before = identity(scene(folder))
    other = scene(folder).with_({"load.force": 2.0, "output.figures": False})
    assert list(changes(identity(other), before)) == [("load.force", [2.0], [1.0])]
    monkeypatch.setattr(module, "version", lambda name: "0.0.1")
    assert [key for key, _, _ in changes(identity(scene(folder)), before)] == [module.VERSION]


def test_heights_in_memory_count_by_their_numbers():
    heights = np.arange(16.0).reshape(4, 4)
    block = {"young_modulus": 4e3, "poisson_ratio": 0.3, "height": 1.0}
    one, other = (
        Scene.from_dict({"surface": {"heights": each, "lengths": [1.0, 1.0]}, "block": block,
                         "load": {"force": 1.0}})
        for each in (heights, 2.0 * heights)
    )  # fmt: skip
    assert [key for key, _, _ in changes(identity(one), identity(other))] == ["surface.heights"]


def test_no_key_that_names_a_file_is_forgotten(folder):
    """A new key whose text speaks of a file must not slip past `Scene.files`."""
    files = scene(folder).files()
    assert files == {key: folder / name for key, name in KEYS.items()}
    keys = {name for name, key in scene_keys().items() if key.meaning.startswith("File of")}
    assert {re.sub(r"\.\d+", "", key) for key in files} == keys | {"law.samples"}  # further files


def test_three_changes_are_told_and_more_are_counted():
    differing = [(f"key {k}", 2.0 * k, 1.0 * k) for k in range(5)]
    assert told(differing[1:2]) == "key 1 was 1.0"
    assert told(differing[:3]).endswith(", key 2 was 2.0")
    assert told(differing).endswith(", key 2 was 2.0 and 2 more")
