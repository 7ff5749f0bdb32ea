"""The page on users' own dolfinx problems is true: its example runs and prints what it says."""

import re
from contextlib import chdir
from pathlib import Path

from helpers.waiting_ranks import alone

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "own_problem.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
FRICTION, *_ = re.findall(r"```python\n(.*?)```", PAGE.partition("## Friction")[2], re.DOTALL)
FIELDS, *_ = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
RING, *_ = re.findall(r"```python\n(.*?)```", PAGE.partition("## Plane and")[2], re.DOTALL)
EXAMPLE = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[-1]


def test_page_begins_with_the_example_of_the_readme():
    after, before = re.findall(r":(?:start-after|end-before): \"(.*)\"", PAGE)
    included = README.partition(after)[2].partition(before)[0]
    assert EXAMPLE in included
    assert "It prints" in included


def test_example_its_friction_and_a_ring_print_what_the_page_says(tmp_path):
    assert len([line for line in EXAMPLE.splitlines() if line]) <= 25
    code = f"{EXAMPLE}\n{FIELDS}\nprint('then it slips')\n{FRICTION}\nprint('a ring')\n{RING}"
    with chdir(tmp_path):
        shown = alone(["-c", code])
    assert shown.returncode == 0, shown.stderr
    assert 'Name="pressure"' in (tmp_path / "face.xdmf").read_text(encoding="utf-8")
    pressed, rubbed = shown.stdout.split("then it slips\n")
    (line,) = pressed.splitlines()
    assert line == re.search(r"It prints `(.*?)`", README).group(1)
    rubbed, ring = rubbed.split("a ring\n")
    assert rubbed.splitlines()[-1] == re.search(r"Its last line is `(.*?)`", PAGE).group(1)
    assert ring == re.search(r"It prints `(.*?)`", PAGE).group(1) + "\n"


def test_example_runs_on_two_ranks(waiting_ranks, tmp_path):
    script = tmp_path / "own.py"
    script.write_text(EXAMPLE, encoding="utf-8")
    done = waiting_ranks(2, script)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(set(done.stdout.split("\n")) - {""}) == 1  # every rank prints the same
