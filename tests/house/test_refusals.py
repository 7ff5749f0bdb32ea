"""The list of refusals is made from the source, for all exit codes."""

import re
import subprocess
import sys


def test_the_list_has_every_exit_code_and_texts_of_all_packages(root):
    done = subprocess.run(
        [sys.executable, "tests/house/refusals.py"],
        cwd=root, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert re.findall(r"^## (\d)", done.stdout, re.MULTILINE) == ["2", "3", "4", "5"]
    for package in ("support", "geometry", "micro", "macro", "multiscale"):
        assert f"**{package}/" in done.stdout
    for text in ("another run is writing to this folder", "… = … does not go with …"):
        assert f"* `{text}`" in done.stdout
