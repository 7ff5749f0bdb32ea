"""A figure has one home, a table or a file of data; pages that repeat it have the same digits."""

import csv
import re
import runpy
import sys
from pathlib import Path
from statistics import median

import pytest
from helpers.picture_answers import still_found
from helpers.waiting_ranks import alone

ROOT = Path(__file__).parents[2]
DATA, BENCHMARKS = ROOT / "demos" / "data", ROOT / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
try:
    PUBLISHED = runpy.run_path(str(BENCHMARKS / "published_times.py"))
finally:
    sys.path.remove(str(BENCHMARKS))
TEXTS = {
    path.stem: path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
}


def says(page, *texts):
    """Check that a page has texts, wherever its lines break."""
    whole = " ".join(TEXTS[page].split())
    for text in texts:
        assert text in whole, f"{page} does not say {text!r}"


def cells(page, after, start):
    """Return the cells of the first row that begins with a text, after another text of a page."""
    rest = TEXTS[page].split(after, maxsplit=1)[1]
    line = next(line for line in rest.splitlines() if line.startswith(f"| {start}"))
    return [cell.strip() for cell in line.strip("| ").split(" | ")][1:]


def numbers(text):
    return [float(one.replace("−", "-")) for one in re.findall(r"[−-]?\d+(?:\.\d+)?", text)]


def times(name):
    """Return the rows of a measured table of the page of times, without its header."""
    rest = TEXTS["speed"].split(f"<!-- times: {name} -->\n\n", maxsplit=1)[1]
    lines = rest[: rest.index("\n\n")].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


rounded, percent = PUBLISHED["rounded"], PUBLISHED["percent"]


def drawn_again(demo, folder):
    """Return the lines that a demo prints of its stored data."""
    words = ROOT / f"demos/{demo}.py", "--data", DATA / f"{demo}.csv", "--out", folder
    done = alone(list(map(str, words)))
    assert done.returncode == 0, done.stderr
    still_found(folder / f"{demo}.png")
    return done.stdout.splitlines()


def test_the_article_says_how_far_consistent_laws_err():
    worst = max(numbers(" ".join(cells("accuracy", "## Couplings", "`consistent`"))))
    article = " ".join((ROOT / "paper" / "paper.md").read_text(encoding="utf-8").split())
    assert f"(`consistent`) reproduce its force within {worst} %" in article
    says("README", f"| `consistent` laws | `concurrent` | ≤ {worst} %")


def test_configurations_of_the_papers_scene():
    with (DATA / "compare_paper.csv").open(encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    time = {one["name"]: rounded(float(one["seconds"])) for one in found}
    error = {one["name"]: percent(float(one["error_force_max"])) for one in found}
    coarse, fine = (f"concurrent, half-space {n} × {n}" for n in (64, 128))
    paper = "the scene as it is: isolated, 4 × 4 patches, circular, 40 × 40 × 25 elements"
    mesh, small = "reference, 1 mesh, 10.4 µm", "concurrent, half-space 128 × 128, small slopes"
    assert PUBLISHED["with_rows"](TEXTS["README"]) == TEXTS["README"]
    says("speed", f"slopes {error[small]} % are left after {time[small]} s")
    early, late = (f"{float(time[one]):.1f}" for one in (coarse, fine))
    says(
        "choosing",
        f"{early} s at 64² heights, {late} s at 128²",
        f"| {error[paper]} % in the paper's scene",
        f"| {time[paper]} s on 40 000 hexahedra",
        f"8 load steps: {time[mesh]} s |",
    )


@pytest.mark.long
def test_errors_of_micro_models(tmp_path):
    row = re.compile(r"\| ([\w-]+, \d+²) \| (.*)% \| (.*)% \| (.*) \|")
    printed = filter(None, map(row.match, drawn_again("micro_accuracy", tmp_path)))
    rows = {one[1]: one for one in printed}
    errors = {key: [percent(float(one[k]) / 100.0) for k in (2, 3)] for key, one in rows.items()}
    times = {key: rounded(float(one[4])) for key, one in rows.items()}
    both = ("", "-independent")
    grids = [f"half-space, {n}²" for n in (32, 64, 128)]
    pairs = [[f"{shape}{kind}, 256²" for shape in ("elliptic", "circular")] for kind in both]
    for one in (*grids, *pairs[0], *pairs[1]):
        model, heights = one.split(", ")
        shown = f"| `{model}` | {heights} | {errors[one][0]} % | {errors[one][1]} %"
        says("accuracy", f"{shown} | {times[one]} ms |")
    force, area = (", ".join(errors[one][k] for one in grids) for k in (0, 1))
    coarse, fine = (errors[f"half-space, {n}²"] for n in (64, 128))
    says("choosing", "its force errs by {} %, its area by {} %".format(*fine))
    says("choosing", "64² heights ({} and {} %)".format(*coarse))
    elliptic, circular = (errors[one][0] for one in pairs[0])
    says("README", f"| {force} % rms |", f"| {elliptic}, {circular} % rms |")
    least, most = sorted(errors[one][0] for one in pairs[1])
    says("force_differs", f"{force} % (of the area {area} %)", f"and {least} to {most} % without")


def test_errors_of_couplings(tmp_path):
    rows = [line.strip("| ").split(" | ") for line in drawn_again("couplings", tmp_path)]
    errors = {tuple(row[:3]): [numbers(one)[0] for one in row[3:]] for row in rows if len(row) == 6}
    planes = [("level plane", n) for n in (1, 2, 4, 8, 16)]
    planes += [("plane tilted by 5 µm/mm", n) for n in (1, 4, 16)]
    shown = {"consistent": "`consistent` |", "isolated": "`isolated` |"}
    for coupling, start in shown.items():
        table = [numbers(one)[0] for one in cells("accuracy", "## Couplings", start)]
        stored = [errors[coupling, plane, f"{n} × {n}"][-1] for plane, n in planes]
        assert table == [round(one) if one > 10.0 else one for one in stored]
    worst = max(max(one) for key, one in errors.items() if key[0].startswith("consistent"))
    turned = max(numbers(" ".join(cells("accuracy", "## Couplings", "largest of seeds"))))
    says("accuracy", f"is at most {worst:.2f} % everywhere")
    says("README", f"≤ {worst:.2f} %; free tilt ≤ {turned:.2f} %")
    says("choosing", f"≤ {worst:.2f} % against `concurrent`", f"≤ {turned:.2f} % where the plane")
    tilted = max(numbers(" ".join(cells("accuracy", "## Couplings", "`isolated` |"))))
    least = re.search(r"it is (\d+) % for seed 1", TEXTS["accuracy"])[1]
    for page in ("choosing", "force_differs"):
        says(page, f"{least} to {tilted:.0f} %, depending on")


@pytest.mark.long
def test_scatter_between_surfaces(tmp_path):
    shown = [numbers(line) for line in drawn_again("scatter", tmp_path)[2:]]
    _, mean, deviation, low, high = shown[-1]
    for page in ("accuracy", "force_differs"):
        says(page, f"{mean:.1f} N on average", f"between {low:.1f} and {high:.1f} N")
    says("accuracy", f"from {shown[0][2]:.0f} % of the mean at 1 µm to {deviation:.0f} % at 8 µm")


def test_errors_against_meshed_roughness():
    surfaces = [f"Set 1, seed {n}" for n in range(101, 106)]
    surfaces += [f"Set 2, seed {n}" for n in range(101, 104)]
    table = [cells("accuracy", "### Finite slopes", one) for one in surfaces]
    bars, errors, small = ([numbers(row[k])[-1] for row in table] for k in (0, 1, 2))
    small = f"{min(small):.1f} to {max(small):.1f} %"
    largest = f"{max(errors) + 1e-9:.1f} %"
    error = f"≤ {largest}, median {median(errors) + 1e-9:.2f} %"
    bar = f"{min(bars):.2f} to {max(bars):.2f} %"
    says("README", f"| {error} |")
    says("choosing", error, f"its own error bar: {bar}")
    says("force_differs", f"{small} too large", f"leave at most {largest}")
    says("limits", f"which costs {small}")


def test_errors_on_bodies():
    foot, cube = "### A body that is no cuboid", "## Contact problems on meshes"
    bars, *errors = (
        numbers(" ".join(cells("accuracy", foot, start)))
        for start in ("error bars of the reference", "`concurrent` |", "`consistent` |")
    )
    largest, widest = max(map(max, errors)), max(bars)
    assert 0.05 < widest <= 0.1  # one digit
    says("README", f"≤ {largest:.2f} % (error bars ≤ {widest:.1f} %)")
    says("choosing", f"≤ {largest:.2f} % against", f"whose error bars are ≤ {widest:.1f} %")
    most, least = (numbers(one)[-1] for one in cells("accuracy", foot, "`concurrent` on a block"))
    says("force_differs", f"is {least:.0f} and {most:.0f} % too stiff")
    assert round(100.0 / (100.0 + most), 1) == 0.5  # the picture's surface, the first of the table
    says("accuracy", "carries half as much as a block of the same height")
    coarse, fine = (max(map(abs, numbers(cells("accuracy", cube, n)[0]))) for n in ("8³", "12³"))
    table = cells("exports", "## CalculiX", "the laws themselves")[0].strip("≤ ")
    says("README", f"≤ {fine:.2f} ({coarse:.2f}) % |", f"≤ {100.0 * float(table):.3f} % |")


def test_pressures_of_the_flange():
    words = " ".join(TEXTS["bodies"].split())
    found = re.search(r"(\d+) MPa beside a bolt and (\d+) MPa .* (\d+) and (\d+) MPa remain", words)
    beside, between, beside_with_fluid, between_with_fluid = map(float, found.groups())
    assert 3.0 < beside / between < beside_with_fluid / between_with_fluid < 4.0
    says("bodies", "beside a bolt is more than three times that between two bolts")


def test_errors_that_runs_state():
    counts = [
        numbers(cells("accuracy", "## Measured errors", f"against {truth}")[0])
        for truth in ("meshed roughness", "finer cells")
    ]
    kept, drawn = map(sum, zip(*counts, strict=True))
    says("README", f"≤ 1.5 × stated in {kept:.0f} of {drawn:.0f} |")
    says("accuracy", "Of forty scenes", "all kept", "in 1 to 7 s each")
    says("choosing", "kept in 40 of 40 random scenes | 1 to 7 s |")


def test_errors_of_discretisation():
    says("accuracy", "4.8, 2.2, 0.75 and 0.35 %", "0.5, 0.2, 0.1 and −0.1 %", "6.5, 2.2 and 0.6 %")
    says("force_differs", "8 × 8 × 5 cells 4.8 %", "along the contact radius 6.5 %")
    says("limits", "4 edges along the contact radius they are 12 % too stiff")


def test_every_table_of_times_has_its_columns():
    for name, (header, _) in PUBLISHED["TABLES"].items():
        rows = times(name)
        assert rows, f"no row in the table {name!r}"
        assert {len(row) for row in rows} == {len(header)}


def test_tables_are_written_in_place():
    text = "a\n\n<!-- times: shear -->\n\n| x |\n| --- |\n| 1 |\n\nb\n"
    for old in (text, text.replace("| x |\n| --- |\n| 1 |\n", "")):
        new = PUBLISHED["with_table"](old, "shear", [["free", "0", "1.5"]])
        head = "| boundary | ν | shear over normal |\n| --- | --- | --- |\n"
        assert new == f"a\n\n<!-- times: shear -->\n\n{head}| free | 0 | 1.5 |\n\nb\n"
    with pytest.raises(SystemExit, match="no table 'shear'"):
        PUBLISHED["with_table"]("a", "shear", [])


def test_times_beside_peers():
    def ratios(rows):
        return [float(re.search(r"\(([\d.]+) ×\)", cell)[1]) for row in rows for cell in row]

    small = times("peers")
    medium = [row[-2:] for row in times("peers_large") if row[0] == "512²"]
    assert len(medium) == 4
    words = " ".join(TEXTS["speed"].split())
    huge = re.search(r"Tamaas took \d+ s, (\d+) times .* \d+ s, (\d+) times", words)
    both = ratios([row[2:4] for row in small]) + ratios(medium)
    span = f"{round(min(both))} to {round(max(both))}"
    tamaas, other = huge.groups()
    says("README", f"{span} times as fast as Tamaas", f"{tamaas} and {other} times on 2048²")
    says("peers", f"{span} times as fast as Tamaas", f"on 2048² cells {tamaas} and {other} times")
    says("choosing", ", ".join(row[1] for row in small) + " |")


def test_other_times():
    unknowns, *_, whole, _newton, _linear, _bytes = times("large_pad")[0]
    says("README", f"{unknowns} unknowns with a law takes {whole} s for 8 load steps on 2 ranks")
    says("choosing", f"brake pad of {unknowns} unknowns, 8 load steps, 2 ranks: {whole} s |")
    first = re.search(r"After (\d+ s) it has", TEXTS["README"])[1]
    says("my_surface", f"The first takes {first} on one core")
    (_, laws, _), (_, hundred, _) = times("couplings")
    each = f"{10.0 * float(hundred.removesuffix(' s')):.1f} ms a load step"
    says("choosing", f"once, {laws} at 256² heights; then {each}")


def test_effect_of_a_hardness():
    row = cells("engineering", "## Hardness", "4, first at 200 N")
    approach, area = (numbers(one) for one in row[1:3])
    says(
        "force_differs",
        "{:.1f} µm with a hardness of 2 GPa and {:.1f} µm without".format(*approach),
        "contact area is {:.1f} and {:.1f} %".format(*area),
    )


def test_hard_cases_of_the_page():
    rows = runpy.run_path(str(ROOT / "docs" / "generated.py"))["hard_cases"]().splitlines()[2:]
    kinds = {row.split(" | ")[0] for row in rows}
    assert kinds == {f"| {number}" for number in range(1, 21)}
    assert any(row.startswith("| 2 | full contact, pressed on | as stiff as") for row in rows)
    says("hard_cases", f"All {len(rows)} cases of twenty kinds", "Twenty kinds of cases")
