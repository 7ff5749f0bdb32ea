"""Folders of results as users may have them: odd names, foreign files, tables that were cut."""

import os
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from helpers.small_scene import SMALL_SCENE
from hypothesis import strategies as st

from patchlaw import InputError
from patchlaw.geometry.files.reading import surface_of
from patchlaw.multiscale import read_contact
from patchlaw.multiscale.cli.command_line import main

TABLES = ("history.csv", "patches.csv", "contacts.csv")
FOREIGN = (*TABLES, "provenance.json", "laws.h5", "contact.h5", "overview.png", "report.html")
CHECKED = SMALL_SCENE.replace('check = "none"', 'check = "last"')
SETTINGS = {
    ".petscrc": "-log_view :left.txt\n",
    "petscrc": "-options_left\n",
    "matplotlibrc": "savefig.format: pdf\n",
    "dolfinx_jit_options.json": '{"timeout": 11}',
    "ffcx_options.json": '{"verbosity": 10}',
}
"""Harmless options in files that libraries look for."""

bytes_of_names = st.binary(min_size=1, max_size=12).filter(
    lambda name: not {0, ord("/")} & set(name) and name not in (b".", b"..")
)
cuts = st.tuples(st.sampled_from(TABLES), st.floats(0.0, 1.0, exclude_max=True))
foreign = st.tuples(st.sampled_from(FOREIGN), st.binary(max_size=40))
settings = st.sampled_from(sorted(SETTINGS))


def quiet(words):
    """Run a command line; return its exit code and what it said of errors."""
    said, told = StringIO(), StringIO()
    with redirect_stdout(said), redirect_stderr(told):
        code = main(words)
    assert "Traceback" not in told.getvalue() and "\x1b" not in said.getvalue() + told.getvalue()
    return code, told.getvalue()


def results(folder):
    """Run the small scene in a folder, once; return the folder of its results."""
    scene, out = folder / "small.toml", folder / "results of the small one"  # others make results
    if not out.is_dir():
        scene.write_text(CHECKED, encoding="utf-8")
        assert quiet(["run", str(scene), "--out", str(out)])[0] == 0
    return out


def named(folder, name):
    """Plan a scene of any name that reads a map of any name; return how that ended."""
    file = Path(os.fsdecode(os.path.join(os.fsencode(folder), name + b".toml")))
    try:
        file.write_text(CHECKED, encoding="utf-8")
    except OSError:
        return "no name"
    code, told = quiet(["plan", str(file)])
    file.unlink()
    assert code == 0, told
    return "planned"


def cut(folder, drawn):
    """Cut a table of results; it is refused by name, or nothing of it is missing."""
    name, share = drawn
    path = results(folder) / name
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    try:
        read_contact(path.parent)
    except InputError as error:
        assert name in str(error)
        return "refused"
    finally:
        path.write_bytes(whole)
    raise AssertionError(f"{name} of {int(share * len(whole))} of {len(whole)} bytes is read")


def beside_foreign(folder, drawn):
    """Run a scene into a folder with a file of the user; it stays as it is."""
    name, content = drawn
    results(folder)
    out = folder / "foreign"
    out.mkdir(exist_ok=True)
    (out / name).write_bytes(content)
    code, told = quiet(["run", str(folder / "small.toml"), "--out", str(out)])
    kept = (out / name).read_bytes() == content
    for path in out.iterdir():
        path.unlink()
    assert code == 2 and kept, (code, told)
    return "refused"


def configured(folder, name):
    """Run a scene where options for a library lie; it is the same, and nothing else is written."""
    whole = read_contact(results(folder))
    where, out = folder / "configured", folder / "of options"
    where.mkdir(exist_ok=True)
    (where / name).write_text(SETTINGS[name], encoding="utf-8")
    words = ["run", str(folder / "small.toml"), "--out", str(out), "--overwrite"]
    with chdir(where):
        assert quiet(words)[0] == 0
    assert [path.name for path in where.iterdir()] == [name]
    (where / name).unlink()
    assert read_contact(out).force_N.tolist() == whole.force_N.tolist()
    return "the same"


def levelled(seed):
    """Tilt a map with missing heights; once levelled, it is the same."""
    rng = np.random.default_rng(seed)
    nx, ny = (int(one) for one in rng.integers(6, 20, 2))
    heights = rng.normal(scale=1e-3, size=(nx, ny))
    heights[rng.random((nx, ny)) < rng.choice([0.0, 0.1])] = np.nan
    heights[: int(rng.integers(0, 3))] = np.nan
    tilt = np.add.outer(rng.normal() * np.arange(nx), rng.normal() * np.arange(ny)) * 1e-2
    steps = {"lengths": (1.0, ny / nx), "missing": "fill", "detrend": "plane"}
    level, tilted = (surface_of(one, **steps).heights for one in (heights, heights + tilt))
    np.testing.assert_allclose(tilted, level, atol=1e-9)  # rounding of tilts of 0.5 mm
    return "the same"
