"""The notebooks are scripts that assert a number; making the documentation executes them all."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "demos" / "notebooks"
SCRIPTS = sorted(FOLDER.glob("*.py"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_notebook_is_a_narrative_of_the_site(script):
    site = (ROOT / "docs" / "conf.py").read_text(encoding="utf-8")
    assert 'nb_execution_mode = "force"' in site and "nb_execution_raise_on_error = True" in site
    text = script.read_text(encoding="utf-8")
    assert text.startswith("# %% [markdown]\n# # ")
    assert "\nassert " in text and len(text.splitlines()) <= 130
    assert f"(../demos/notebooks/{script.name})" in (ROOT / "docs" / "demos.md").read_text("utf-8")
    assert f"\n/demos/notebooks/{script.stem}\n" in (ROOT / "docs" / "index.md").read_text("utf-8")


@pytest.mark.long
def test_a_kernel_shows_tables_progress_and_pictures():
    pytest.importorskip("ipykernel")
    nbclient, jupytext = pytest.importorskip("nbclient"), pytest.importorskip("jupytext")
    notebook = jupytext.read(FOLDER / "my_map.py")
    last, place = notebook.cells[-1], {"metadata": {"path": FOLDER}}
    last.source += "\nfrom mpi4py import MPI\nMPI.COMM_WORLD.size, MPI.Is_initialized()"
    nbclient.NotebookClient(notebook, timeout=300, resources=place).execute()
    shown = [one for cell in notebook.cells for one in cell.get("outputs", ())]
    pages = [one.data["text/html"] for one in shown if "text/html" in one.get("data", {})]
    assert any("surface.filter.short" in page for page in pages)
    assert any("load step 4/4" in page for page in pages)
    assert any("History of 4 load steps" in page and "0.6028 ± 0.0029" in page for page in pages)
    assert any("image/png" in one.get("data", {}) for one in shown)
    assert shown[-1].data["text/plain"] == "(1, True)"


@pytest.mark.slow
def test_a_kernel_shows_a_picture_of_pyplot_once():
    """Older matplotlib shows the first one only after the magic that chooses where it is drawn."""
    pytest.importorskip("ipykernel")
    nbclient, jupytext = pytest.importorskip("nbclient"), pytest.importorskip("jupytext")
    notebook = jupytext.read(FOLDER / "joint_stiffness.py")
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": FOLDER}}).execute()
    shown = [one for cell in notebook.cells for one in cell.get("outputs", ())]
    assert sum("image/png" in one.get("data", {}) for one in shown) == 1
    for script in SCRIPTS:
        text = script.read_text(encoding="utf-8")
        assert ("\n# %matplotlib inline\n" in text) == ("pyplot" in text), script.name
