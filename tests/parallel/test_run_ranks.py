"""The whole chain on 1, 2 and 3 ranks: same numbers, same refusals, no hang."""

import csv
import re
from functools import cache

import h5py
import numpy as np
import pytest
from helpers.on_ranks import RANKS

from patchlaw.multiscale import read_contact
from patchlaw.multiscale.cli import main
from patchlaw.multiscale.results.contacts import SPOT_COLUMNS

PAPER = "demos/scenes/paper.toml"
SMALL = ["surface.grid=[40, 40]", "load.steps=2", "output.figures=false", "output.report=false"]
SCENES = {
    "cube, patchwise": ["block.cells=[8, 8, 5]", "patches.grid=[4, 2]"],
    "cube, pointwise": [
        "block.cells=[8, 8, 5]", "patches.grid=[4, 2]", "coupling.interface=pointwise",
    ],
    # most of the block lies beside the interface: a rank of three owns none of it
    "wide block, tilted": [
        "block.cells=[4, 4, 4]", "block.margin=4 mm", "block.margin_cells=6",
        "load.tilt=['2 um/mm', '-1 um/mm']", "coupling.interface=pointwise",
    ],
    "half-space with slopes, tilted": [
        "coupling.kind=analytic", "micro.model=half-space", "micro.finite_slopes=true",
        "load.tilt=['2 um/mm', '-1 um/mm']", "output.check=all",
    ],
    "condensed, up and down": [
        "block.cells=[8, 8, 5]", "patches.grid=[4, 2]",
        "load.approach=['8 um', '2 um']", "load.tilt=[0.002, 0.001]", "output.fields=true",
    ],
    "free to turn, on the mesh": [
        "block.cells=[8, 8, 5]", "patches.grid=[4, 2]", "coupling.interface=pointwise",
        "load.tilt=free",
    ],
    "consistent, decomposed, free to turn": [
        "block.cells=[8, 8, 5]", "coupling.kind=consistent", "micro.model=half-space",
        "load.tilt=free",
    ],
    "concurrent, errors measured": [
        "coupling.kind=concurrent", "micro.model=half-space", "micro.finite_slopes=true",
        "output.check=all",
    ],
    "concurrent, free to turn under a force": [
        "coupling.kind=concurrent", "micro.model=half-space", "micro.finite_slopes=true",
        "block.height=0.3 mm", "load={force='1 N', steps=2, tilt='free'}",
    ],
    "concurrent, with a hardness, conducting": [
        "coupling.kind=concurrent", "micro.model=half-space", "micro.hardness='300 MPa'",
        "load.approach=['8 um', '4 um']", "conductance.conductivity=['50 W/m/K']",
    ],
    "leaking": [
        "coupling.kind=analytic", "micro.model=half-space", "leak.viscosity='1 mPa s'",
        "leak.pressures=['2 bar', '1 bar']",
        "output.check=all",
    ],
    "concurrent, sheared there and back": [
        "coupling.kind=concurrent", "micro.model=half-space", "friction.coefficient=0.3",
        "load.shear=[['1 um', '0 um'], ['-1 um', '0.5 um']]", "load.shear_steps=2",
    ],
    "concurrent, wearing": [
        "coupling.kind=concurrent", "micro.model=half-space", "load.approach='4 um'",
        "wear.coefficient=1e-7 mm^2/N", "load.sliding=['1 m', '20 m']", "output.check=all",
    ],
    "concurrent, fretting": [
        "coupling.kind=concurrent", "micro.model=half-space", "friction.coefficient=0.3",
        "friction.coupled=false", "wear.coefficient=1e-4 mm^2/N",
        "load.shear=[['0.3 um', '0 um'], ['-0.3 um', '0 um']]", "load.shear_steps=1",
    ],
    "laws that conduct": [
        "block.cells=[8, 8, 5]", "patches.grid=[4, 2]", "conductance.conductivity='50 W/m/K'",
    ],
    "concurrent, asperities": [
        "coupling.kind=concurrent", "micro.model=elliptic", "load.tilt=free",
    ],
    "cells for an accuracy": [
        "accuracy=0.05", "coupling.kind=concurrent", "micro.model=half-space",
        "output.check=all",
    ],
    "laws of the half-space, contact on request": [
        "block.cells=[8, 8, 5]", "micro.model=half-space", "output.contact=all",
        "patches.grid=[3, 2]",
    ],
}  # fmt: skip
NUMBERS = (
    "approach_mm", "tilt_x", "tilt_y", "force_N", "mean_pressure_MPa", "contact_area_fraction",
    "mean_separation_mm", "contacts", "force_error_N", "approach_error_mm", "peak_pressure_MPa",
    "interface_stiffness_N_per_mm", "approach_stiffness_N_per_mm", "leak_x_mm3_per_s",
    "leak_error_y_mm3_per_s", "constriction_y_fraction", "shear_force_x_N", "shear_force_y_N",
    "tangential_stiffness_N_per_mm", "dissipated_mJ", "worn_volume_mm3", "worn_depth_mm", "slid_mm",
)  # fmt: skip


def table(path, names):
    with path.open(encoding="utf-8") as file:
        rows = csv.DictReader(file)
        return np.array([[float(row[name] or 0.0) for name in names] for row in rows])


def numbers(out):
    """Return the columns of a run's tables that are compared."""
    patches = ("closure_mm", "pressure_MPa", "contact_area_fraction")
    tables = [table(out / "history.csv", NUMBERS), table(out / "patches.csv", patches)]
    spots = out / "contacts.csv"
    return [*tables, table(spots, SPOT_COLUMNS)] if spots.exists() else tables


@pytest.fixture(scope="module")
def alone(root, tmp_path_factory):
    """Return a function that runs a scene in this process, once, and returns its numbers."""

    @cache
    def found(name):
        out = tmp_path_factory.mktemp("alone")
        words = ["run", str(root / PAPER), "--out", str(out), "--set", *SMALL, *SCENES[name]]
        assert main(words) == 0
        return numbers(out)

    return found


LONG = {
    "cells for an accuracy",
    "cube, patchwise",  # as the wide block
    "concurrent, asperities",
    "concurrent, sheared there and back",
    "concurrent, fretting",
    "condensed, up and down",
    "consistent, decomposed, free to turn",
    "free to turn, on the mesh",
    "concurrent, with a hardness, conducting",
    "half-space with slopes, tilted",
    "laws of the half-space, contact on request",
    "laws that conduct",
    "wide block, tilted",
}


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "ranks"), [
    *((name, 2) for name in sorted(SCENES.keys() - LONG)),
    *(pytest.param(name, 3, marks=pytest.mark.long) for name in sorted(LONG)),
])  # fmt: skip
def test_same_numbers_on_any_number_of_ranks(waiting_ranks, alone, tmp_path, scene, ranks):
    words = ("-m", "patchlaw", "run", PAPER, "--out", tmp_path, "--set", *SMALL, *SCENES[scene])
    done = waiting_ranks(ranks, *words)
    assert done.returncode == 0, done.stderr
    for one, more in zip(alone(scene), numbers(tmp_path), strict=True):
        # residuals are driven to 1e-9 of the load; closures and pressures follow linearly
        assert np.all(np.abs(more - one) <= 1e-8 * np.abs(one).max(axis=0))


@pytest.fixture(scope="module")
def folders(waiting_ranks, tmp_path_factory):
    """Return a function that runs the paper's scene on some ranks, once, and returns its folder."""

    @cache
    def made(ranks, *scene):
        out = tmp_path_factory.mktemp(f"on_{ranks}")
        words = ("-m", "patchlaw", "run", PAPER, "--out", out, "--set", *scene)
        done = waiting_ranks(ranks, *words)
        assert done.returncode == 0, done.stderr
        return out

    return made


@pytest.mark.long
def test_contacts_read_back_and_their_pictures_are_those_of_one(folders):
    scene = [
        "surface.grid=[32, 32]", "surface.spectrum.waves=[2, 6]", "coupling.kind=analytic",
        "micro.model=half-space", "micro.hardness=300 MPa", "load.approach=['8 um', '0 um']",
        "load.steps=1", "output.contact=all", "output.check=none",
    ]  # fmt: skip
    found, pictures = [], []
    for count in (1, 2):
        out = folders(count, *scene)
        found.append(read_contact(out))
        report = (out / "report.html").read_text()
        pictures.append(re.findall(r'alt="Load step (\d.*?)" src="(.*?)"', report))
    one, more = found
    assert one.unloading.tolist() == more.unloading.tolist() == [False, True]
    for name in ("pressure_MPa", "gap_mm", "plastic_depth_mm"):
        values = getattr(one, name)
        np.testing.assert_allclose(getattr(more, name), values, rtol=0, atol=1e-8 * values.max())
    assert [caption for caption, _ in pictures[0]] == [caption for caption, _ in pictures[1]]
    assert len(pictures[0]) == 2


@pytest.mark.long
def test_ranks_draw_the_figures_of_one(folders):
    drawn = []
    for ranks in (1, 2):
        out = folders(ranks, *SMALL, "coupling.kind=analytic", "output.figures=true")
        drawn.append({path.name: path.read_bytes() for path in out.glob("*.png")})
    assert set(drawn[0]) == {
        "overview.png", "surface.png", "curves.png", "pressures.png", "contact.png",
        "over_pressure.png",
    }  # fmt: skip
    assert drawn[0] == drawn[1]


@pytest.mark.slow
def test_a_rank_may_own_nothing_of_the_interface(waiting_ranks):
    """The premise of the wide block above: see that it holds."""
    code = (
        "from mpi4py import MPI; from patchlaw.multiscale import Run, Scene;"
        f"scene = Scene.load('{PAPER}', {SMALL + SCENES['wide block, tilted']});"
        "run = Run(scene, MPI.COMM_WORLD); list(run.load_steps());"
        "counts = MPI.COMM_WORLD.gather(len(run.coupling.model.face.quadrature.x));"
        "print('facet points', counts) if counts else None"
    )
    done = waiting_ranks(3, "-c", code)
    assert "facet points" in done.stdout, done.stderr
    assert ", 0" in done.stdout or "[0" in done.stdout, done.stdout


@pytest.mark.parametrize(
    ("override", "text"),
    [
        ("block.young=3", "block.young: unknown key; did you mean 'young_modulus'?"),
        ("surface.spectrum.waves=[2, 200]", "heights is too coarse"),  # found as it is made
    ],
)
def test_wrong_input_ends_all_ranks_with_one_message(waiting_ranks, tmp_path, override, text):
    out = tmp_path / "out"
    words = ("-m", "patchlaw", "run", PAPER, "--out", out, "--set", override)
    done = waiting_ranks(2, *words, timeout=60)
    assert done.returncode == 2
    assert done.stderr.count("patchlaw: ") == 1
    assert text in done.stderr
    assert not out.exists()


@pytest.mark.parametrize("content", [None, np.full((8, 8), np.nan)], ids=["no file", "no numbers"])
def test_bad_heights_end_all_ranks(waiting_ranks, root, tmp_path, content):
    text = (root / PAPER).read_text(encoding="utf-8").replace("spectrum = {", 'file = "h.npy" # {')
    (tmp_path / "scene.toml").write_text(text.replace("grid = [256, 256]", ""), encoding="utf-8")
    if content is not None:
        np.save(tmp_path / "h.npy", content)
    out = tmp_path / "out"
    words = ("-m", "patchlaw", "run", tmp_path / "scene.toml", "--out", out)
    done = waiting_ranks(2, *words, timeout=60)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("patchlaw: ") == 1
    assert "h.npy" in done.stderr
    assert not out.exists()


def sorted_fields(folder):
    """Return the last fields, in an order of nodes and cells that no division changes."""
    with h5py.File(folder / "fields.h5") as file:
        ((places, cells),) = [
            (mesh["geometry"][...], mesh["topology"][...]) for mesh in file["Mesh"].values()
        ]
        middles = places[cells].mean(axis=1)
        orders = [np.lexsort(points.round(9).T) for points in (places, middles)]
        functions = {name: group["2"][...] for name, group in file["Function"].items()}
    assert set(functions) == {"displacement", "stress", "von_Mises", "pressure"}
    order = {len(places): orders[0], len(middles): orders[1]}
    return {name: values[order[len(values)]] for name, values in functions.items()}


@pytest.mark.long
@pytest.mark.parametrize("ranks", RANKS)
def test_fields_of_any_number_of_ranks(folders, ranks):
    scene = (
        "coupling.kind=concurrent", "micro.model=half-space", "block.cells=[8, 8, 5]",
        "output.fields=[1, 2]",
    )  # fmt: skip
    found = [sorted_fields(folders(count, *SMALL, *scene)) for count in (1, ranks)]
    for name, values in found[0].items():
        # the linear solver goes to 1e-10 of the load
        np.testing.assert_allclose(found[1][name], values, atol=1e-7 * np.abs(values).max())
