"""The direction of imports (engine <- app <- ui), and what the window's process may load."""

import ast
import functools
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# The top-level modules that the files of a package must not import.
FORBIDDEN = {
    "engine": {"app", "ui", "benchmarks", "moderngl", "glcontext", "glfw", "imgui_bundle", "OpenGL", "multiprocessing"},
    "app": {"ui", "benchmarks", "moderngl", "glcontext", "glfw", "imgui_bundle", "OpenGL"},
    "ui": {"benchmarks"},
    "assets": {"benchmarks"},
}
COMPOSITION_ROOT = "app/__main__.py"

# What the window's process imports before it shows: slow libraries would cost its 1.5 seconds.
WINDOW_SIDE = (
    "engine/core/errors.py",
    "engine/curve/*.py",
    "engine/material/*.py",
    "engine/scene/description.py",
    "engine/scene/builtin.py",
    "app/__main__.py",
    "app/document/*.py",
    "app/document/commands/*.py",
    "app/files/session.py",
    "app/editor/*.py",
    "app/messages/*.py",
    "app/worker/shared_arrays.py",
    "app/worker/channel.py",
    "app/worker/client.py",
    "ui/*.py",
    "ui/gl/*.py",
    "ui/modes/*.py",
    "ui/modes/*/*.py",
    "ui/modes/*/gl/*.py",
    "ui/panels/*.py",
)
SLOW_LIBRARIES = ("numba", "trimesh", "scipy", "embreex", "matplotlib", "OpenEXR", "PyOpenColorIO")


@functools.cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imported_modules(path: Path) -> list[tuple[int, str]]:
    """(line, absolute name) of each module that a file imports, wherever in the file that stands."""
    package = list(path.relative_to(ROOT).parent.parts)
    found: list[tuple[int, str]] = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            found.append((node.lineno, ".".join([*base, *([node.module] if node.module else [])])))
    return found


def imported_at_once(path: Path) -> list[str]:
    """The modules that a file imports as soon as it is imported itself: outside functions and `if TYPE_CHECKING`."""
    found: list[str] = []

    def walk(statements: list[ast.stmt]) -> None:
        for node in statements:
            if isinstance(node, ast.Import):
                found.extend(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.extend(f"{node.module}.{alias.name}" for alias in node.names)
            elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                walk(node.orelse)
            elif isinstance(node, (ast.If, ast.Try, ast.With, ast.ClassDef)):
                walk([each for each in ast.iter_child_nodes(node) if isinstance(each, ast.stmt)])

    walk(parsed(path).body)
    return found


def package_graph(root: str) -> dict[str, set[str]]:
    """Which of a package's parts, folders or single files, each of them imports."""
    parts = {path.stem for path in (ROOT / root).iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    graph: dict[str, set[str]] = {part: set() for part in parts - {"__init__"}}
    for path in (ROOT / root).rglob("*.py"):
        part = path.relative_to(ROOT / root).with_suffix("").parts[0]
        for name in imported_at_once(path):
            package, _, rest = name.partition(".")
            if package == root and part in graph:
                graph[part] |= {rest.split(".")[0]} & graph.keys() - {part}
    return graph


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def window_side_modules() -> list[str]:
    paths = {path for pattern in WINDOW_SIDE for path in ROOT.glob(pattern) if not path.name.endswith("_kernels.py")}
    return sorted(module_name(path) for path in paths)


@pytest.mark.parametrize("package", sorted(FORBIDDEN))
def test_imports_go_one_way(package: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in sorted((ROOT / package).rglob("*.py"))
        if str(path.relative_to(ROOT)) != COMPOSITION_ROOT
        for line, name in imported_modules(path)
        if name.split(".")[0] in FORBIDDEN[package]
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("package", "others"),
    [
        ("core", ("triple_product", "zonal_harmonics")),
        ("triple_product", ("zonal_harmonics",)),
        ("zonal_harmonics", ("triple_product",)),
    ],
)
def test_transfer_models_share_a_core_and_do_not_know_each_other(package: str, others: tuple[str, ...]) -> None:
    paths = sorted((ROOT / "engine" / "realtime" / package).glob("*.py"))
    names = [(path.name, name) for path in paths for _, name in imported_modules(path)]
    assert any(name.startswith("engine.") for _, name in names)
    assert not [each for each in names for other in others if each[1].startswith(f"engine.realtime.{other}")]


def test_relative_imports_are_resolved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    (tmp_path / "engine" / "curve").mkdir(parents=True)
    file = tmp_path / "engine" / "curve" / "a.py"
    file.write_text("from ...ui import window\nfrom . import b\nfrom ..light.lights import cut\nimport app.cli\n")
    # Three dots climb out of engine.curve to the top, one dot stays in it, two dots reach engine.
    assert imported_modules(file) == [
        (1, "ui"),
        (2, "engine.curve"),
        (3, "engine.light.lights"),
        (4, "app.cli"),
    ]


@pytest.mark.parametrize(
    ("package", "folder", "file"),
    [("engine", "scene", "core"), ("app", "worker", "document"), ("ui", "panels", "theme")],
)
def test_the_parts_of_a_package_import_each_other_in_no_circle(package: str, folder: str, file: str) -> None:
    graph = package_graph(package)
    assert file in graph[folder] and folder in set().union(*graph.values())  # folders and files are both seen
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        pytest.fail(f"a circle, each imported by the next: {', '.join(error.args[1])}")


def test_window_process_loads_no_slow_library() -> None:
    """One fresh interpreter imports the modules in turn and names the first of them that brings a slow library in."""
    program = f"""
import importlib, sys
for name in {window_side_modules()!r}:
    importlib.import_module(name)
    slow = sorted(set({SLOW_LIBRARIES!r}) & set(sys.modules))
    if slow:
        sys.exit(f"{{name}} imports {{', '.join(slow)}}")
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr


def test_the_first_curve_imports_nothing() -> None:
    """What a library imports when first called would hold up the window's thread just when the scene arrives."""
    program = """
import sys
from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
layer = make_layer(MODELS["rough_conductor"])
factor = layer.model.factors[0].name
there = set(sys.modules)
layer.with_operators(factor, (Operator("amplify", "y", 0.1, 0.2, 0.4, 0.5, 2.0),)).coefficients(factor, 64)
came = sorted(set(sys.modules) - there)
if came:
    sys.exit(f"imported by a curve's first evaluation: {', '.join(came)}")
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr
