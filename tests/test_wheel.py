"""What the build makes of the sources. `make wheel` installs the result and uses it."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [path for package in ("app", "assets", "engine", "ui") for path in sorted((ROOT / package).rglob("*.py"))]
MODULES = ("app.", "engine.", "ui.", "assets.")


@pytest.fixture(scope="module")
def build() -> ModuleType:
    """setup.py, without what it does when it is run."""
    import setuptools

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setuptools, "setup", lambda **_: None)
        spec = importlib.util.spec_from_file_location("setup_of_insitu", ROOT / "setup.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "written, built",
    [
        ("from app.worker import worker\n", "from insitu.app.worker import worker\n"),
        ("from engine import (\n    plan,\n)\n", "from insitu.engine import (\n    plan,\n)\n"),
        ("import app.worker as worker\n", "import insitu.app.worker as worker\n"),
        ("def f():\n    x = 'é'; from ui.gl import y\n", "def f():\n    x = 'é'; from insitu.ui.gl import y\n"),
        ("from application import app\n", "from application import app\n"),
        ("from . import app\n", "from . import app\n"),
        ('"""\nfrom app import x\n"""\nimport numpy as app\n', '"""\nfrom app import x\n"""\nimport numpy as app\n'),
    ],
)
def test_imports_name_the_outer_package(build: ModuleType, written: str, built: str) -> None:
    assert build.with_outer_package(written, "file.py") == built


def test_an_import_that_binds_another_name_is_refused(build: ModuleType) -> None:
    with pytest.raises(ValueError, match="file.py:2: expected"):
        build.with_outer_package("\nimport app.document.document\n", "file.py")


def test_every_source_can_be_moved(build: ModuleType) -> None:
    for path in (*SOURCES, ROOT / "insitu.py"):
        moved = ast.parse(build.with_outer_package(path.read_text(), str(path)))
        for node in statements(moved):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            names += [each.name for each in node.names] if isinstance(node, ast.Import) else []
            assert not any(f"{name}.".startswith(MODULES) for name in names), (path, ast.unparse(node))


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements in a syntax tree: a tenth of its nodes."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.ExceptHandler, ast.match_case)):
            yield child
            yield from statements(child)


def test_modules_in_text_are_given_to_what_finds_them_in_a_wheel() -> None:
    """`named` and `qualified` know where they are; `importlib` and `python -m` would look for them at the top."""
    for path in (path for path in SOURCES if not path.is_relative_to(ROOT / "assets")):
        text = path.read_text()
        if not any(word in text for word in ("import_module", "__import__", '"-m"')):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("importlib.import_module", "__import__"):
                (name, *_) = node.args
                assert not (isinstance(name, ast.Constant) and str(name.value).startswith(MODULES)), path
            if isinstance(node, ast.List):
                words = [each.value if isinstance(each, ast.Constant) else None for each in node.elts]
                if "-m" in words[:-1]:
                    assert words[words.index("-m") + 1] is None, (path, ast.unparse(node))
