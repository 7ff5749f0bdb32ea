#!/usr/bin/env bash
# PyVista: a scene exported as one HTML page by trame (Plotter.trame.export_html).
#
# Guess: Plotter.export_html of PyVista's documentation makes a page that needs no network and shows what the window shows.
# Seen: without trame-pyvista, and without nest_asyncio2, which trame-pyvista[jupyter] alone brings, it is an ImportError. Meanwhile the
# program downloads another viewer from gitlab.kitware.com (WASM, by trame-vtklocal). The page looks for icons at kitware.github.io; it has
# meshes and colour bars, but no text (add_text), and the title of an example of vtk.js.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pyvista==0.49.1 vtk==9.7.2
show() {
    python - <<'END' 2>errors.log
import sys

import pyvista

plotter = pyvista.Plotter(off_screen=True)
plotter.add_mesh(pyvista.Sphere(), scalars=pyvista.Sphere().points[:, 2].copy())
plotter.add_text("a caption")
try:
    plotter.export_html("page.html")
    print("a page is written, downloads:", "trame_vtklocal.module.wasm" in sys.modules)
except ImportError as error:
    print("ImportError:", error)
END
}
show | tee without.txt
grep -q "ImportError: .*trame-pyvista" without.txt
"$folder/venv/bin/pip" install -qq --no-compile --disable-pip-version-check --only-binary=:all: trame-pyvista==0.2.3 trame-vtk==2.11.17
show | tee half.txt
grep -q "ImportError: .*nest_asyncio2" half.txt
"$folder/venv/bin/pip" install -qq --no-compile --disable-pip-version-check --only-binary=:all: "trame-pyvista[jupyter]==0.2.3"
show | tee with.txt
grep -q "a page is written, downloads: True" with.txt
python - <<'END'
import base64
import io
import re
import zipfile

page = open("page.html", encoding="utf-8").read()
icons = sorted(set(re.findall(r"https://kitware.github.io/vtk-js/icon/[a-z-]+", page)))
print("icons:", icons, "title:", re.search("<title>(.*?)</title>", page)[1])
archive = zipfile.ZipFile(io.BytesIO(base64.b64decode(re.search('base64Str = "([^"]+)"', page)[1])))
scene = b"".join(archive.read(name) for name in archive.namelist()).decode("latin-1")
kinds = sorted(set(re.findall(r'"type":\s*"(vtk[A-Za-z]+)"', scene)))
print("kinds:", kinds, "text:", "a caption" in scene)
assert icons and "a caption" not in scene and "vtkScalarBarActor" in kinds
END
