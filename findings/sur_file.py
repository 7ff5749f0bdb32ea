"""Writes Digital Surf files (.sur) and reads their heights by three programs; for sur_*.sh."""

import struct

import SurfaceTopography
import surfalize
from rsciio.digitalsurf import file_reader


def sur(first, inversion=0, offset=0.0):
    """Return a file of 4 × 3 heights of 0.1 µm each: 512 bytes of header, then whole numbers.

    Args:
        first: The first of the numbers, which rise by 1 along x and then y.
        inversion: The header's inversion flag.
        offset: The header's offset of heights [µm].
    """
    last = first + 11
    text = [b"X", b"Y", b"Z", *[b"um"] * 6]
    head = struct.pack("<12s4H30s30s", b"DIGITAL SURF", 0, 1, 1, 2, b"map", b"none")
    head += struct.pack("<5H8xH5i", 0, 0, 0, 0, 0, 32, first, last, 4, 3, 12)
    head += struct.pack("<3f", 2.0, 2.0, 0.1) + b"".join(one.ljust(16) for one in text)
    head += struct.pack("<3f3H", 1, 1, 1, 0, inversion, 0)
    head = head.ljust(466, b"\0") + struct.pack("<3f", 0.0, 0.0, offset)
    return head.ljust(512, b"\0") + struct.pack("<12i", *range(first, last + 1))


def heights(file):
    """Return the lines [µm] that three programs read."""
    return {
        "SurfaceTopography": SurfaceTopography.read_topography(file).heights().T,
        "surfalize": surfalize.Surface.load(file).data,
        "rosettasciio": file_reader(file)[0]["data"],
    }
