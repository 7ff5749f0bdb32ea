"""Strategies for damaged law files and checkpoints, and what reading them may end in."""

from io import BytesIO

import h5py
import numpy as np
from hypothesis import strategies as st

from patchlaw.multiscale import Run, Scene, read_laws, write_laws
from patchlaw.multiscale.runs.output.results_folder import read_checkpoint
from patchlaw.support import InputError
from patchlaw.support.files import checksum_hdf5, write_record

ODD = (
    np.zeros(0), np.zeros(1), np.zeros((3, 3)), np.full(5, np.nan), np.full(5, 1e308), np.arange(5),
    -np.arange(7.0), np.array(3.0), np.zeros(5, complex), np.array([b"text"] * 3), "text", 10**18,
    np.array([10**9, 10**9]), np.array([-1, 2]), np.array([2.5, 2.0]), np.zeros(5, "f4,i4"), True,
)  # fmt: skip


def originals(base, folder):
    """Return the bytes of a law file and of a checkpoint of a small run."""
    run = Run(Scene.from_dict(base | {"coupling": {"kind": "isolated"}}))
    write_laws(folder / "whole.laws", run.make_laws())
    write_record(folder / "whole.state", run.checkpoint({}))
    return (folder / "whole.laws").read_bytes(), (folder / "whole.state").read_bytes()


@st.composite
def flipped(draw, whole):
    """Draw bytes of which some are overwritten, cut off or put in."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data)))
        data[at : at + draw(st.sampled_from([1, 2, 8, 10**7]))] = draw(st.binary(max_size=8))
    return bytes(data)


@st.composite
def rewritten(draw, whole):
    """Draw a sound HDF5 file with some of its attributes and columns replaced or gone."""
    image = BytesIO(whole)
    with h5py.File(image, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        for _ in range(draw(st.integers(1, 2))):
            place, content = file[draw(st.sampled_from(["/", *names]))], draw(st.sampled_from(ODD))
            change = draw(st.sampled_from(["attribute", "column", "promise", "group", "link"]))
            if change == "attribute" and len(place.attrs):
                place.attrs[draw(st.sampled_from(sorted(place.attrs)))] = content
            elif place.name != "/":
                name = place.name
                del file[name]
                names = [other for other in names if not f"/{other}/".startswith(f"{name}/")]
                if change == "column":
                    file[name] = content
                elif change == "promise":  # of far more than the file holds
                    file.create_dataset(name, (10**6, 10**6), "f8", chunks=(100, 100))
                elif change == "group":
                    file.create_group(name)
                elif change == "link":
                    file[name] = h5py.ExternalLink("/etc/passwd", "/")
    return checksum_hdf5(image.getvalue())


def read(path, reader):
    """Read a file; return how that ended. What is wrong must be told with the file's name."""
    try:
        reader(path)
    except InputError as error:
        assert str(error).startswith(str(path)), error
        return "refused"
    return "read"


READERS = (read_laws, read_checkpoint)
