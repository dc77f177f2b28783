"""The corridor: imports go one way, only programs print and exit, heavy packages and plug-ins wait to be asked for."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import tracker

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("tracker", "reference", "eval")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))

# Each imports only from those before it. A new module needs a place here.
ORDER = {
    "tracker": (
        "errors", "system_libraries", "whole_file", "yaml_files", "handover", "geometry", "frame", "first_masks",
        "in_order", "sources", "latest", "view", "pointing", "saliency", "cloud", "region", "reference_views",
        "grounding", "symmetry", "declared_symmetry", "concept", "revolution", "measures", "matching", "appearance",
        "projection", "least_squares", "closest_points", "threads", "umeyama", "hypotheses", "registration",
        "camera_motion", "claims", "whereabouts", "silhouette", "proposals", "lighting", "surroundings",
        "verification", "glance", "contacts", "refinement", "confidence", "pose_filter", "rest", "config", "result",
        "smoothing", "stopwatch", "search", "found", "rivals", "belief", "looking", "lockstep", "places", "reviews",
        "track", "pipeline", "remote_control", "bop_rows", "pose_files", "ros_results", "output", "saved_run",
        "overlay", "video", "rerun_log", "viewer", "web", "terminal", "summary", "frame_by_frame", "__main__",
    ),
    "reference": (
        "vocabulary", "prompts", "llm", "vocabulary_cache", "viewsphere", "cross_check", "keyframes", "planes",
        "segment", "group_means", "one_light", "fusion", "quality", "self_alignment", "symmetry_detection", "onboard",
        "growing", "completion", "unposed", "live", "sheet", "plate", "view_plate", "__main__",
    ),
}  # fmt: skip
MAY_IMPORT = {"tracker": {"tracker"}, "reference": {"reference", "tracker"}, "eval": {"eval", "reference", "tracker"}}

SAY_NOTHING = {"utils", "util", "helpers", "helper", "common", "misc", "base", "core", "manager", "tools", "shared"}
WAYS_OUT = {"print", "exit", "quit", "input", "sys.exit", "os._exit", "SystemExit"}
RUN_WHAT_THEY_READ = {"pickle", "marshal", "shelve", "dill", "cloudpickle"}
READ_NOTHING = {"Parallel", "delayed", "parallel_config"}  # of joblib, whose load() runs what it reads
RUNS_WHAT_IT_GETS = {"eval", "exec", "compile", "torch.load", "yaml.load", "yaml.unsafe_load", "os.system"}
ARRAYS = re.compile(r"\b(NDArray|Floats|Float32s|Mask|ndarray|Tensor)\b")
ALL_HEAVY = {"numpy", "scipy", "cv2", "pydantic", "torch", "open3d", "transformers", "trimesh"}
LIGHT = {
    "tracker": ALL_HEAVY,
    "tracker.errors": ALL_HEAVY,
    "tracker.sources": ALL_HEAVY - {"numpy", "scipy"},
    "tracker.saliency": {"torch", "open3d", "transformers", "trimesh"},
    "tracker.concept": {"torch", "open3d", "transformers", "trimesh"},
    "tracker.__main__": {"torch", "open3d", "transformers", "trimesh"},
    "reference.__main__": {"torch", "open3d", "transformers"},
    "eval.__main__": {"torch", "open3d", "transformers"},
}


@dataclass(frozen=True)
class Import:
    """module: absolute name. late: inside a function. typing: for type checkers only. where: file and line."""

    module: str
    late: bool
    typing: bool
    where: str

    @property
    def top(self) -> str:
        return self.module.partition(".")[0]


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def is_module(name: str) -> bool:
    path = ROOT.joinpath(*name.split("."))
    return path.with_suffix(".py").exists() or (path / "__init__.py").exists()


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def nodes(path: Path) -> Iterator[tuple[ast.AST, str]]:
    """Every node with its file and line."""
    for node in ast.walk(parsed(path)):
        yield node, f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}"


def imports(path: Path) -> Iterator[Import]:
    def within(node: ast.AST, late: bool, typing: bool) -> Iterator[Import]:
        for child in ast.iter_child_nodes(node):
            where = f"{path.relative_to(ROOT)}:{getattr(child, 'lineno', 0)}"
            if isinstance(child, ast.Import):
                yield from (Import(alias.name, late, typing, where) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.module is not None, f"{where}: a relative import"
                assert child.level == 0, f"{where}: a relative import"
                for alias in child.names:  # `from package import module` names the module
                    inner = f"{child.module}.{alias.name}"
                    yield Import(inner if is_module(inner) else child.module, late, typing, where)
            else:
                inside = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef)
                guarded = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
                yield from within(child, late or inside, typing or guarded)

    return within(parsed(path), False, False)


def rooms(package: str) -> Iterator[tuple[str, Path]]:
    """The files of a package but its front door, each with the module or folder directly under the package."""
    for path in FILES:
        top, _, rest = module_of(path).partition(".")
        if top == package and rest:
            yield rest.partition(".")[0], path


def test_a_program_imports_only_itself_and_those_before_it() -> None:
    wrong = [
        f"{found.where} imports {found.module}"
        for path in FILES
        for found in imports(path)
        if found.top in PACKAGES and found.top not in MAY_IMPORT[path.relative_to(ROOT).parts[0]]
    ]
    assert wrong == []


@pytest.mark.parametrize("package", ORDER)
def test_a_module_imports_only_from_those_before_it(package: str) -> None:
    order = ORDER[package]
    assert {room for room, _ in rooms(package)} == set(order), "every module needs a place in the order"
    wrong = [
        f"{found.where} imports {found.module}"
        for room, path in rooms(package)
        for found in imports(path)
        if found.top == package
        and (found.module == package or order.index(found.module.split(".")[1]) > order.index(room))
    ]
    assert wrong == []


def test_no_module_imports_itself_by_a_detour() -> None:
    own = {module_of(path): path for path in FILES}
    graph = {
        module: {found.module for found in imports(path) if not found.late and not found.typing} & own.keys()
        for module, path in own.items()
    }
    assert set(TopologicalSorter(graph).static_order()) == set(own)


def test_only_programs_and_tables_of_plug_ins_import_the_project_s_own_modules_late() -> None:
    wrong = [
        f"{found.where} imports {found.module}"
        for package in ORDER
        for _, path in rooms(package)
        for found in imports(path)
        if found.late and found.top in PACKAGES and path.name not in ("__main__.py", "__init__.py")
    ]
    assert wrong == []


def test_only_programs_print_and_exit() -> None:
    wrong = []
    for path in (path for path in FILES if path.name != "__main__.py"):
        # the one way out that all programs share
        allowed = {"sys.exit"} if path == ROOT / "tracker" / "terminal.py" else set()
        for node, where in nodes(path):
            name = node.func if isinstance(node, ast.Call) else node.exc if isinstance(node, ast.Raise) else None
            if name is not None and ast.unparse(name) in WAYS_OUT - allowed:
                wrong.append(f"{where} {ast.unparse(name)}")
    assert wrong == []


def test_every_name_says_something_and_every_module_says_what_it_is() -> None:
    assert [path for path in FILES if SAY_NOTHING & set(path.relative_to(ROOT).with_suffix("").parts)] == []
    assert [path for path in FILES if path.read_text() and not ast.get_docstring(parsed(path))] == []


def test_nothing_runs_what_it_reads() -> None:
    wrong = [found.where for path in FILES for found in imports(path) if found.top in RUN_WHAT_THEY_READ]
    for path in FILES:
        for node, where in nodes(path):
            if isinstance(node, ast.Import) and any(alias.name.split(".")[0] == "joblib" for alias in node.names):
                wrong.append(where)
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "joblib":
                harmless = node.module == "joblib" and {alias.name for alias in node.names} <= READ_NOTHING
                wrong += [] if harmless else [where]
            if isinstance(node, ast.Call):
                pickled = any(keyword.arg == "allow_pickle" for keyword in node.keywords)
                if pickled or ast.unparse(node.func) in RUNS_WHAT_IT_GETS:
                    wrong.append(where)
    assert wrong == []


def test_what_stages_return_is_frozen_and_compares_no_arrays() -> None:
    wrong, seen = [], 0
    for path in (path for package in ORDER for room, path in rooms(package) if room != "__main__"):
        for node, where in nodes(path):
            for decorator in node.decorator_list if isinstance(node, ast.ClassDef) else []:
                options = ast.unparse(decorator)
                if isinstance(node, ast.ClassDef) and options.startswith("dataclass"):
                    fields = [ast.unparse(part.annotation) for part in node.body if isinstance(part, ast.AnnAssign)]
                    comparable = "eq=False" in options or not any(ARRAYS.search(field) for field in fields)
                    seen += 1
                    if not ("frozen=True" in options and "slots=True" in options and comparable):
                        wrong.append(f"{where} {node.name}")
    assert wrong == []
    assert seen > 15


def test_what_is_imported_is_declared_and_an_extra_is_imported_late() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = {distribution(line) for line in project["dependencies"]}
    extras = project["optional-dependencies"]
    optional = {distribution(line) for name, lines in extras.items() if name != "dev" for line in lines}
    installed = packages_distributions()
    wrong = []
    for found in (found for path in FILES for found in imports(path)):
        if found.top not in PACKAGES and found.top not in sys.stdlib_module_names:
            of = {distribution(name) for name in installed.get(found.top, [found.top])}
            if not of & (needed | optional if found.late or found.typing else needed):
                wrong.append(f"{found.where} imports {found.module}")
    assert wrong == []


def distribution(requirement: str) -> str:
    """Name of the distribution as PyPI normalises it."""
    return re.sub(r"[-_.]+", "-", re.split(r"[\s<>=!~;\[]", requirement)[0]).lower()


def test_importing_is_light_until_something_is_asked_for() -> None:
    asked = f"import importlib, sys\nfor name in {list(LIGHT)}:\n    importlib.import_module(name)\n"
    asked += "    print(name, *{module.partition('.')[0] for module in sys.modules})\n"
    ran = subprocess.run([sys.executable, "-c", asked], cwd=ROOT, capture_output=True, text=True, check=True)  # noqa: S603
    loaded = {name: set(packages) for name, *packages in map(str.split, ran.stdout.splitlines())}
    assert [(name, loaded[name] & heavy) for name, heavy in LIGHT.items() if loaded[name] & heavy] == []


def test_the_public_names_are_what_they_say() -> None:
    assert sorted(tracker.__all__) == list(tracker.__all__) == sorted(tracker._HOME)
    for name in tracker.__all__:
        assert getattr(tracker, name) is getattr(importlib.import_module(tracker._HOME[name]), name)
    with pytest.raises(AttributeError, match="no attribute 'Tracker'"):
        _ = tracker.Tracker  # pyright: ignore[reportAttributeAccessIssue]
