# %% [markdown]
# # The report of a run
#
# What one learns: what the first command writes. The map of ground steel is pressed, and the top of
# `report.html` is photographed by a browser without a screen. Its headline is the answer with its
# error; below stand the map, the pressures on it, the load history, contacts, errors by cause, and
# what the run was made of.
#
# Where no Chromium is on PATH, the picture is `overview.png`, one of those in the report.
#
# Run time: 10 s. `--quick` for a coarser map, `--out DIR` for the folder of the results.

# %%
import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image

from patchlaw import read_history

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/report"))
choice = parser.parse_args()
scene, results = Path(__file__).parent / "scenes" / "my_surface.toml", choice.out / "my_surface"
quick = ["--set", "surface.resample=[64, 64]", "load.steps=2"] if choice.quick else []
words = ["run", str(scene), "--out", str(results), "--overwrite", *quick]
subprocess.run([sys.executable, "-m", "patchlaw", *words], check=True)

# %% [markdown]
# The browser shows the page 820 pixels wide.

# %%
picture = choice.out / "report.png"
browser = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))), None)
if browser is None:
    print("no Chromium on PATH: the picture is overview.png")
    shutil.copy(results / "overview.png", picture)
else:
    shot = ["--window-size=820,720", "--force-device-scale-factor=1.5", f"--screenshot={picture}"]
    how = ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    page = (results / "report.html").resolve().as_uri()
    subprocess.run([browser, *how, *shot, page], check=True, capture_output=True)
    with Image.open(picture) as image:
        picked = image.convert("RGB")
    picked.save(picture, dpi=(200, 200), optimize=True)

# %% [markdown]
# The approach under 20 N, with its error; a third of the heights a side lack the short waves.

# %%
approach = 1e3 * read_history(results).approach_mm[-1]
print(f"approach {approach:.4f} µm")
assert abs(approach - (0.498 if choice.quick else 0.6028)) < 0.0029
