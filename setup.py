"""Builds the wheel, in which `app`, `engine`, `ui`, `shaders` and `assets` lie inside one package, `insitu`.

The packages are generic words, and a wheel that installed them beside other people's would collide with theirs. In the
checkout they stay where they are, and import one another as `engine.curve`; the build moves them and writes
`insitu.engine.curve` into their import statements. `insitu.py`, the public interface, becomes `insitu/__init__.py`.

The other way, the repository's root as the package `insitu`, was tried: an editable installation can map a name to a
folder, but mypy, pytest and editors cannot, and would need the checkout to be a folder of that name.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.egg_info import egg_info

NAME = "insitu"
MOVED = ("app", "assets", "engine", "shaders", "ui")
_IMPORT = re.compile(rf"\b(from|import)(\s+)({'|'.join(MOVED)})\b")


class BuildOnePackage(build_py):
    """Copies the packages as ever, then moves the copies into one. An editable installation leaves all in place."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            move_into_one(Path(self.build_lib))


class NameOnePackage(egg_info):
    """Lists `insitu` alone among the packages that the wheel installs."""

    def run(self) -> None:
        super().run()
        Path(self.egg_info, "top_level.txt").write_text(f"{NAME}\n", encoding="utf-8")


def move_into_one(build: Path) -> None:
    """build: the folder that is packed into the wheel."""
    outer = build / NAME
    outer.mkdir()
    (build / f"{NAME}.py").rename(outer / "__init__.py")
    (outer / "py.typed").touch()  # what type checkers of other people's code look for
    for name in MOVED:
        (build / name).rename(outer / name)
    for path in outer.rglob("*.py"):
        path.write_text(with_outer_package(path.read_text(encoding="utf-8"), str(path)), encoding="utf-8")


def with_outer_package(source: str, path: str) -> str:
    """The source text, its imports of moved packages naming `insitu` first. Raises ValueError for `import app.x`, which
    would bind another name than its reader uses; `from app import x` and `import app.x as x` say what they bind."""
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.ImportFrom(module=str(module), level=0):
                moved = module.partition(".")[0] in MOVED
            case ast.Import(names=names):
                moved = any(each.name.partition(".")[0] in MOVED for each in names)
                if moved and (len(names) > 1 or names[0].asname is None):
                    raise ValueError(f"{path}:{node.lineno}: expected `from ... import` or `import ... as`")
            case _:
                continue
        if moved:
            # Columns of the syntax tree count bytes.
            line, column = lines[node.lineno - 1].encode(), node.col_offset
            before, statement = line[:column].decode(), line[column:].decode()
            lines[node.lineno - 1] = before + _IMPORT.sub(rf"\1\2{NAME}.\3", statement, count=1)
    return "".join(lines)


setup(cmdclass={"build_py": BuildOnePackage, "egg_info": NameOnePackage})
