"""The pages for readers: their links lead somewhere, and the first of them is short."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from app.files import old_names

ROOT = Path(__file__).resolve().parents[1]
CODE = ("app", "assets", "benchmarks", "docs", "engine", "examples", "scripts", "shaders", "tests", "ui")
FOLDERS = f"(?:{'|'.join(CODE)})"
SUFFIXES = "py|glsl|toml|md|sh|json|png|csv"
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "assets" / "README.md"])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if not target.startswith(("http://", "https://", "#")):
            assert (page.parent / target.partition("#")[0]).exists(), target


def files_named(text: str) -> list[str]:
    """Paths of the repository's files: in code, such as `app/editor/editor.py`, and in drawings between fences."""
    quoted = [code for code in re.findall(r"`([^`\n]+)`", text) if re.fullmatch(FOLDERS + r"/[\w./-]*", code)]
    return [*quoted, *re.findall(rf"(?<![\w/.-]){FOLDERS}/[\w./-]*\.(?:{SUFFIXES})\b", text)]


def exists(name: str) -> bool:
    """A file or folder, a module without its ending, or NAME, which stands for one to be made."""
    return "NAME" in name or (ROOT / name).exists() or (ROOT / f"{name}.py").exists()


def test_what_counts_as_a_file() -> None:
    text = "`app/cli/`, `render.exr`, `ui/x.py` and\n```\nengine/a/b.py ─► x/app/c.py\n``` `examples/*.py`"
    assert files_named(text) == ["app/cli/", "ui/x.py", "ui/x.py", "engine/a/b.py"]


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=lambda page: page.stem)
def test_files_named_exist(page: Path) -> None:
    assert not [name for name in files_named(page.read_text()) if not exists(name)]


def test_bare_names_of_modules_exist() -> None:
    """Pages name a module without its folder where the folder is clear, as `solver.py`."""
    known = {path.name for folder in CODE for path in (ROOT / folder).rglob("*.*")}
    wrong = {}
    for page in (page for page in PAGES if page.name != "CHANGELOG.md"):
        names = set(re.findall(r"`(\w+\.(?:py|glsl))`", page.read_text()))
        if missing := names - known - {"insitu.py", "setup.py"}:
            wrong[page.name] = missing
    assert not wrong


def test_every_page_is_linked() -> None:
    """From a page that a reader reaches from README."""
    reached, waiting = set[Path](), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        reached.add(page)
        targets = re.findall(r"\]\(([^)\s]+\.md)\)", page.read_text())
        waiting += {(page.parent / target).resolve() for target in targets} - reached
    assert {page for page in PAGES if page.name != "CHANGELOG.md"} <= reached


def test_the_first_page_is_short() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= 8192


def test_versions_are_told_shortly() -> None:
    """At most sixty lines a version; the first is the one that pyproject.toml names."""
    versions = re.split(r"(?m)^## ", (ROOT / "CHANGELOG.md").read_text())[1:]
    assert all(len(version.splitlines()) <= 60 for version in versions)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert versions[0].splitlines()[0] == project["version"]


def test_the_glossary_has_the_names_of_earlier_versions() -> None:
    renamed = {**old_names._SESSION_KEYS, **old_names._VIEW_KEYS, **old_names._STEP_KEYS, **old_names._OPTIONS}
    table = (ROOT / "docs" / "glossary.md").read_text().partition("## Names of earlier versions")[2]
    rows = [row for row in table.splitlines() if row.startswith("|")]
    for old, new in {**renamed, **old_names._AWAITED_PICTURES}.items():
        assert any(old in row.split("|")[1] and new in row.split("|")[2] for row in rows), old
