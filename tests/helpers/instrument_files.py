"""Small files in instruments' formats, composed as the formats' public descriptions have it.

Every maker returns the bytes of a file for whole numbers of an increment; where a format knows
missing heights the one at [2, 1] is missing.
"""

import struct

import numpy as np

NX, NY = 7, 5
NUMBERS = np.random.default_rng(7).integers(-300, 300, size=(NX, NY))
GAP = (2, 1)
STEP = (2e-3, 3e-3)  # sides of a cell [mm]
UNIT = 1e-6  # height of an increment [mm]


def rows(kind, missing=None, factor=1, flip=False):
    """Return the numbers as lines of an image along x, in a binary type."""
    numbers = factor * NUMBERS.astype(float)
    if missing is not None:
        numbers[GAP] = missing
    image = numbers.T[::-1] if flip else numbers.T
    return image.astype(kind)


def al3d():
    """Alicona: tags of 52 bytes, lines of floats in metres, padded to 8 bytes."""
    tags = {"Cols": NX, "Rows": NY, "PixelSizeXMeter": 1e-3 * STEP[0]}
    tags |= {"PixelSizeYMeter": 1e-3 * STEP[1], "InvalidPixelValue": 1e30}
    offset = 17 + 52 * (len(tags) + 3) + 256
    tags["DepthImageOffset"] = offset
    tags = {"Version": 1, "TagCount": len(tags)} | tags
    head = b"AliconaImaging\0\r\n" + b"".join(
        struct.pack("20s30s2s", key.encode(), str(value).encode(), b"\r\n")
        for key, value in tags.items()
    )
    image = np.pad(rows("<f4", missing=1e30, factor=1e-3 * UNIT), ((0, 0), (0, NX % 2)))
    return head + bytes(256) + image.tobytes()


def sur(inversion=0, unit="mm", encoding="latin-1"):
    """Digital Surf: 512 bytes of header, whole numbers; the lowest less two is missing."""
    low, high = int(NUMBERS.min()), int(NUMBERS.max())
    text = [part.encode(encoding) for part in ("X", "Y", "Z", *[unit] * 6)]
    head = struct.pack("<12s4H30s30s", b"DIGITAL SURF", 0, 1, 1, 2, b"map", b"none")
    # material, acquisition, range, special points, absolute; bytes of a number; range; size
    head += struct.pack("<5H8xH5i", 0, 0, 0, 1, 0, 32, low, high, NX, NY, NX * NY)
    head += struct.pack("<3f" + "16s" * 9, *STEP, UNIT, *text) + struct.pack("<3f", 1, 1, 1)
    head += struct.pack("<HHH", 0, inversion, 0)
    head = head.ljust(512, b"\0")
    return head + rows("<i4", missing=low - 2).tobytes()


def sdf():
    """ISO 25178-71, text; lengths in metres, BAD where missing."""
    head = {"ManufacID": "none", "CreateDate": "010120260000", "ModDate": "010120260000"}
    head |= {"NumPoints": NX, "NumProfiles": NY, "Xscale": 1e-3 * STEP[0], "Yscale": 1e-3 * STEP[1]}
    head |= {"Zscale": 1e-3 * UNIT, "Zresolution": -1, "Compression": 0, "DataType": 6}
    head |= {"CheckType": 0}
    lines = ["aISO-1.0", *(f"{key} = {value}" for key, value in head.items()), "*"]
    image = rows(int).astype(object)
    image[GAP[::-1]] = "BAD"
    lines += [" ".join(map(str, line)) for line in image]
    return "\n".join([*lines, "*", ""]).encode()


def sdf_binary(kind="<i4", missing=-(2**31)):
    """ISO 25178-71, binary: 81 bytes of header, lines along x of one of the eight types."""
    code = ("|u1", "<u2", "<u4", "<f4", "|i1", "<i2", "<i4", "<f8").index(np.dtype(kind).str)
    head = struct.pack("<8s10s12s12s", b"bISO-1.0", b"none", b"010120260000", b"010120260000")
    head += struct.pack("<2H4d3B", NX, NY, *(1e-3 * side for side in (*STEP, UNIT)), -1, 0, code, 0)
    return head + rows(kind, missing=missing).tobytes()


def nms(unit=1e-6):
    """NanoFocus: 3468 bytes of header, the range of heights [µm] in 65534 parts; no gaps.

    Args:
        unit: Unit of the distances of points in the header [mm].
    """
    head, (low, high) = bytearray(3468), (1e3 * UNIT * part for part in (-32767, 32767))
    head[:8] = b"\1\2nms\0\0\0"  # zeros would be an empty MATLAB file
    struct.pack_into("<2d", head, 16, low, high)
    struct.pack_into("<2I2d", head, 1368, NX, NY, *(side / unit for side in STEP))
    return bytes(head) + (rows("<i4") + 32767).astype("<u2").tobytes()


def opd():
    """Wyko: a directory of blocks; heights in wavelengths of nm, x first, y downward."""
    numbers = NUMBERS[:, ::-1].astype("<i2")
    numbers[GAP[0], NY - 1 - GAP[1]] = 32767
    raster = struct.pack("<3H", NX, NY, 2) + numbers.tobytes()
    blocks = [("RAW_DATA", 3, raster), ("Wavelength", 7, struct.pack("<f", 1e6 * UNIT * 1000))]
    blocks += [("Mult", 6, struct.pack("<h", 1000)), ("Pixel_size", 7, struct.pack("<f", STEP[0]))]
    blocks += [("Aspect", 7, struct.pack("<f", STEP[1] / STEP[0]))]
    entries = [("Directory", 1, 24 * (len(blocks) + 1)), *((n, t, len(b)) for n, t, b in blocks)]
    head = b"".join(struct.pack("<16shiH", n.encode(), t, size, 0) for n, t, size in entries)
    return b"\1\0" + head + b"".join(content for _, _, content in blocks)


def mi():
    """Molecular Imaging: keys of 14 characters, a deflection and a topography, last line on top."""
    head = {"fileType": "Image", "xPixels": NX, "yPixels": NY}
    head |= {"xLength": 1e-3 * STEP[0] * NX, "yLength": 1e-3 * STEP[1] * NY}
    lines = [f"{key:14}{value}" for key, value in head.items()]
    for label, unit in (("Deflection", "V"), ("Topography", "um")):
        # numbers are those of the type's range, 32768 increments
        keys = {"bufferLabel": label, "bufferUnit": unit, "bufferRange": 32768 * UNIT * 1e3}
        lines += [f"{key:14}{value}" for key, value in keys.items()]
    text = "\n".join([*lines, f"{'data':14}BINARY", ""]).encode()
    image = rows("<i2", flip=True).tobytes()
    return text + bytes(len(image)) + image


def bcrf():
    """BCR: 2048 characters of keys, floats in nm; larger than 1.7e38 is missing."""
    keys = {"fileformat": "bcrf", "headersize": 2048, "xpixels": NX, "ypixels": NY}
    keys |= {"xlength": 1e6 * STEP[0] * NX, "ylength": 1e6 * STEP[1] * NY, "bit2nm": 1}
    keys |= {"xunit": "nm", "yunit": "nm", "zunit": "nm", "intelmode": 1}
    head = "\n".join([*(f"{key} = {value}" for key, value in keys.items()), ""]).encode()
    return head.ljust(2048) + rows("<f4", missing=3e38, factor=1e6 * UNIT).tobytes()


def metropro(sign=0):
    """Zygo MetroPro: 834 bytes of header, phases of 1/4096 wavelength, the largest is missing."""
    head = bytearray(834)
    struct.pack_into(">4sHI", head, 0, b"\x88\x1b\x03\x6f", 1, 834)
    struct.pack_into(">HHI", head, 68, NX, NY, 4 * NX * NY)
    # interferometric factor, wavelength, aperture, obliquity, magnification, width of a cell
    struct.pack_into(">6f", head, 164, 1.0, 1e-3 * UNIT * 4096, 0.1, 1.0, 1.0, 1e-3 * STEP[0])
    struct.pack_into(">h", head, 232, sign)
    return bytes(head) + rows(">i4", missing=2147483640).tobytes()


def gwy(marked=None):
    """Gwyddion: objects of named components; in metres, NaN where missing; perhaps with a mask.

    Args:
        marked: Where the mask is set, shape (NX, NY).
    """

    def made(name, *components):
        inside = b"".join(f"{key}\0{kind}".encode() + value for key, kind, value in components)
        return name.encode() + struct.pack("<xL", len(inside)) + inside

    def field(image):
        metre, components = made("GwySIUnit", ("unitstr", "s", b"m\0")), []
        for axis, count, step in zip("xy", (NX, NY), STEP, strict=True):
            components.append((f"{axis}res", "i", struct.pack("<i", count)))
            components.append((f"{axis}real", "d", struct.pack("<d", 1e-3 * step * count)))
        components += [("si_unit_xy", "o", metre), ("si_unit_z", "o", metre)]
        numbers = struct.pack("<L", image.size) + image.tobytes()
        return made("GwyDataField", *components, ("data", "D", numbers))

    fields = {"data": rows("<f8", missing=np.nan, factor=1e-3 * UNIT)}
    if marked is not None:
        fields["mask"] = marked.T.astype("<f8")
    parts = [(f"/0/{name}", "o", field(image)) for name, image in fields.items()]
    return b"GWYP" + made("GwyContainer", *parts)


def gsf(**stated):
    """Gwyddion's simple field: lines of text, zeros up to a multiple of 4, rows along x of floats.

    Args:
        stated: Lines of the header instead of those in metres; None for none.
    """
    lines = {"XRes": NX, "YRes": NY, "Title": "Höhe", "XYUnits": "m", "ZUnits": "m"}
    lines |= {"XReal": 1e-3 * STEP[0] * NX, "YReal": 1e-3 * STEP[1] * NY} | stated
    known = [f"{name} = {value}\n" for name, value in lines.items() if value is not None]
    head = "".join(["Gwyddion Simple Field 1.0\n", *known]).encode()
    image = rows("<f4", missing=np.nan, factor=1e-3 * UNIT)
    return head + bytes(4 - len(head) % 4) + image.tobytes()


MAKERS = {
    "scan.al3d": al3d, "scan.sur": sur, "scan.sdf": sdf, "scan.opd": opd, "scan.mi": mi,
    "scan.bcrf": bcrf, "scan.dat": metropro, "binary.sdf": sdf_binary, "scan.gwy": gwy,
}  # fmt: skip
WITHOUT_GAPS = ("scan.mi",)
SQUARE_CELLS = ("scan.dat",)


def gwyddion_text(value_unit="m", scale=1e-3 * UNIT, words=("Channel", "Width", "Height")):
    """Return Gwyddion's text export of the same map: sizes in µm, values in a unit."""
    sizes = [f"{1e3 * step * count:g} µm" for step, count in zip(STEP, (NX, NY), strict=True)]
    label = "Value units" if words[0] == "Channel" else "Einheiten"
    head = [f"# {words[0]}: Höhe", f"# {words[1]}: {sizes[0]}", f"# {words[2]}: {sizes[1]}"]
    lines = [" ".join(repr(float(scale * number)) for number in line) for line in NUMBERS.T]
    return "\n".join([*head, f"# {label}: {value_unit}", *lines, ""])
