"""The list of refusals is made from the source, for all exit codes."""

import re
import runpy


def test_the_list_has_every_exit_code_and_texts_of_all_packages(root):
    page = runpy.run_path(str(root / "docs" / "refusals.py"))["page"]()
    assert re.findall(r"^## (\d)", page, re.MULTILINE) == ["2", "3", "4", "5"]
    for package in ("support", "geometry", "micro", "macro", "multiscale"):
        assert f"**{package}/" in page
    for text in (
        "another run is writing to this folder",
        "does not go with coupling.kind = '…', …",
    ):
        assert f"* `{text}`" in page
