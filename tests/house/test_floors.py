"""The structure that CONTRIBUTING.md draws: imports go down only, heavy packages stay in place.

And nothing that a file or a word says is ever run.
"""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BELOW = {
    "support": set(),
    "geometry": {"support"},
    "micro": {"support", "geometry"},
    "macro": {"support", "geometry"},
    "multiscale": {"support", "geometry", "micro", "macro"},
}
FINITE_ELEMENTS = {"dolfinx", "petsc4py", "mpi4py", "ufl", "basix", "ffcx"}
# folders and flat modules from the ground up: each imports only from lines above its own
FLOORS = {
    "support": [
        "errors readable",
        "checks",
        "files network packages parallel quantities",
        "arguments",
    ],
    "geometry": [
        "face_frame interpolant materials sliding",
        "filters spring_bed",
        "surface",
        "patches sliders spectrum statistics",
        "preparation rigid_plane",
        "files",
        "asperities contact_state meshes",
    ],
    "micro": [
        "closed_forms gap_cells gap_pools",
        "gap_multigrid",
        "gap_iteration",
        "transport",
        "boundary_elements model",
        "complementarity",
        "half_space",
        "asperities friction wear",
    ],
    "macro": [
        "disk_caches",
        "compat",
        "mesh",
        "linear_solvers",
        "eigenmodes elastic_body",
        "bodies",
        "contact",
        "compliance fields",
    ],
    "multiscale": [
        "machine",
        "laws loading",
        "console results",
        "scene",
        "bodies",
        "models",
        "observers",
        "runs",
        "cli",
    ],
}
# within a room of multiscale: what stands above its other modules, from the ground up
UPPER = {
    "laws": ["exported_law", "export"],
    "results": ["figures"],
    "models": [
        "problem",
        "cell_contact patch_contact face_contact",
        "reference_meshes",
        "validity",
        "coupling",
        "cell_coupling reference_coupling representative_coupling",
        "patch_coupling setup",
    ],
    "runs": [
        "refining",
        "resolving",
        "scene_run",
        "output",
        "cases",
        "configurations",
        "sweep",
        "comparison",
        "difference",
    ],
}
HEAVY = {
    "support": FINITE_ELEMENTS | {"h5py", "matplotlib", "pydantic"},
    "geometry": FINITE_ELEMENTS | {"h5py", "matplotlib", "pydantic"},
    "micro": FINITE_ELEMENTS | {"h5py", "matplotlib", "pydantic"},
    # arrays of XDMF are checked by h5py before dolfinx reads them
    "macro": {"matplotlib", "pydantic"},
    # the command line alone names MPI and hands options to PETSc
    "multiscale": {"dolfinx", "ufl", "basix", "ffcx"},
}


@cache
def nodes(path):
    """Return the syntax tree of a module, as a list."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


BARE = re.compile(rf"\b(?:import|from)\s+(?:{'|'.join(BELOW)})\b")
"""What an import of a package by its bare name looks like; texts and comments may, too."""


def imports(path):
    """Return the folders of the project, and the foreign packages, that a module imports from."""
    return {module.split(".")[0] for module in modules_imported(path)}


@cache
def modules_imported(path):
    """Return the full names that a module imports from, and those of what it takes there.

    Names within the project go without the package's own.
    """
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found += [alias.name.removeprefix("patchlaw.") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            home = f"{node.module}.".removeprefix("patchlaw.")
            found += [f"{home}{alias.name}" for alias in node.names]
    return found


@pytest.mark.parametrize("package", BELOW)
def test_imports_go_down_only(package):
    forbidden = (set(BELOW) - BELOW[package] - {package}) | HEAVY[package]
    for path in (ROOT / package).rglob("*.py"):
        crossing = forbidden & set(imports(path))
        assert not crossing, f"{path.name} imports {crossing}"


@pytest.mark.parametrize("package", FLOORS)
def test_folders_and_flat_modules_go_down_only(package):
    floor = {name: i for i, names in enumerate(FLOORS[package]) for name in names.split()}
    found = {path.stem for path in (ROOT / package).iterdir() if path.suffix == ".py"}
    found |= {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert set(floor) == found - {"__init__"}
    assert len(floor) == len(found - {"__init__"}), "a module stands beside a folder of its name"
    for path in (ROOT / package).rglob("*.py"):
        here = path.relative_to(ROOT / package).with_suffix("").parts[0]
        if here == "__init__":
            continue
        for module in modules_imported(path):
            top, _, rest = module.partition(".")
            other = rest.split(".")[0]
            if top == package and other in floor and other != here:
                assert floor[other] < floor[here], f"{path.name} imports {module}"


@pytest.mark.parametrize("room", UPPER)
def test_rooms_of_multiscale_have_their_upper_floors(room):
    floor = {name: i for i, names in enumerate(UPPER[room], 1) for name in names.split()}
    folder = ROOT / "multiscale" / room
    for path in folder.rglob("*.py"):
        here = path.relative_to(folder).with_suffix("").parts[0]
        for module in modules_imported(path):
            start, _, rest = module.partition(f"multiscale.{room}.")
            other = rest.split(".")[0]
            if not start and other != here and here != "__init__":
                above = floor.get(other, 0)
                assert above < floor.get(here, 1), f"{path.name} imports {module}"


def test_modules_import_by_the_package_that_is_installed():
    """Only in the project's folder would a bare name be found, and as a second copy of a module."""
    for folder in (*BELOW, "patchlaw", "demos", "docs", "tests"):
        for path in (ROOT / folder).rglob("*.py"):
            if not BARE.search(path.read_text(encoding="utf-8")):
                continue
            wanted = [one for one in nodes(path) if isinstance(one, ast.ImportFrom) and one.module]
            names = {one.module.split(".")[0] for one in wanted}
            plain = [one for one in nodes(path) if isinstance(one, ast.Import)]
            names |= {alias.name.split(".")[0] for one in plain for alias in one.names}
            assert not names & set(BELOW), path
    for package in BELOW:  # the façade and the packages' lists of names are for users
        for path in (ROOT / package).rglob("*.py"):
            wanted = [one for one in nodes(path) if isinstance(one, ast.ImportFrom)]
            assert not [one for one in wanted if one.module == "patchlaw"], path


def test_no_module_needs_itself():
    paths = [path.relative_to(ROOT) for package in BELOW for path in (ROOT / package).rglob("*.py")]
    modules = {".".join(path.with_suffix("").parts): path for path in paths}
    needs = {}
    for module, path in modules.items():
        if path.name != "__init__.py":  # these only hand on
            names = set(modules_imported(ROOT / path))
            needs[module] = (names | {name.rpartition(".")[0] for name in names}) & set(modules)
    tuple(TopologicalSorter(needs).static_order())  # CycleError names a circle


def test_only_a_scene_asks_which_coupling_it_has():
    """All others ask what a coupling has; rules between sections of a scene stand with these."""
    for path in (ROOT / "multiscale").rglob("*.py"):
        if path.name == "comparison.py" or path.parent.name == "scene":
            continue
        for node in nodes(path):
            if isinstance(node, ast.Compare):
                parts = [one for one in ast.walk(node) if isinstance(one, ast.Attribute)]
                kinds = [ast.unparse(one.value) for one in parts if one.attr == "kind"]
                assert all(one.endswith("dtype") for one in kinds), path
            elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
                assert "Coupling" not in ast.unparse(node), path


def test_only_one_module_knows_dolfinx_releases():
    for path in (ROOT / "macro").rglob("*.py"):
        if path.name != "compat.py":
            assert "__version__" not in path.read_text(encoding="utf-8")


def test_no_two_test_files_have_one_name():
    """Without packages of tests, pytest imports the first of them for both."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


def test_helpers_of_tests_exist():
    """A test that imports a helper that has gone fails where it is marked long, too."""
    known = {path.stem for path in (ROOT / "tests" / "helpers").glob("*.py")}
    for path in (*(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        assert set(re.findall(r"^from helpers\.(\w+) import", text, re.MULTILINE)) <= known, path


RUNS_TEXT = {"eval", "exec", "compile", "__import__"}
RUNS_FILES = {
    ("pickle", "load"), ("pickle", "loads"), ("pickle", "Unpickler"), ("marshal", "load"),
    ("marshal", "loads"), ("shelve", "open"), ("os", "system"), ("os", "popen"),
    ("np", "fromregex"), ("yaml", "load"), ("runpy", "run_path"),
}  # fmt: skip


def dangers(tree):
    """Yield what in a module could run what data say: no eval, no pickles, no shell."""
    for node in tree:
        if not isinstance(node, ast.Call):
            continue
        function = node.func
        if isinstance(function, ast.Name) and function.id in RUNS_TEXT:
            yield function.id
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            if (function.value.id, function.attr) in RUNS_FILES:
                yield f"{function.value.id}.{function.attr}"
            stated = any(keyword.arg == "allow_pickle" for keyword in node.keywords)
            if (function.value.id, function.attr) == ("np", "load") and not stated:
                yield "np.load"  # by default it loads none either, in releases of today
        for keyword in node.keywords:
            allowed = isinstance(keyword.value, ast.Constant) and keyword.value.value is False
            if keyword.arg in ("shell", "allow_pickle") and not allowed:
                yield keyword.arg


@pytest.mark.parametrize("package", BELOW)
def test_no_module_runs_data(package):
    modules = list((ROOT / package).rglob("*.py"))
    assert modules
    for path in modules:
        assert list(dangers(nodes(path))) == [], path


@pytest.mark.parametrize("text", [
    "eval('1')", "exec(text)", "pickle.load(file)", "os.system('ls')",
    "subprocess.run('ls', shell=True)", "np.load(path)",
    "np.lib.format.read_array(file, allow_pickle=True)",
])  # fmt: skip
def test_the_search_finds(text):
    assert list(dangers(ast.walk(ast.parse(text))))
