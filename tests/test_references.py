"""Every [Key, place] in code, shaders, scenes and documents names an entry of docs/references.bib."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BIBLIOGRAPHY = ROOT / "docs" / "references.bib"
CITING = ("app", "assets", "docs", "engine", "scripts", "shaders", "tests", "ui")
SUFFIXES = {".py", ".glsl", ".md", ".toml", ".sh"}


def keys_cited(text: str) -> set[str]:
    """Keys within brackets: name and two-digit year, alone or before a place; semicolons between several."""
    parts = (part.strip() for inside in re.findall(r"\[([^\[\]]*)\]", text) for part in inside.split(";"))
    return {found[1] for part in parts if (found := re.match(r"([A-Z][A-Za-z]+\d\d)(?:,|$)", part))}


def entries() -> list[str]:
    return re.findall(r"^@\w+\{(\w+),", BIBLIOGRAPHY.read_text(encoding="utf-8"), re.MULTILINE)


def citing_files() -> list[Path]:
    inside = (path for folder in CITING for path in (ROOT / folder).rglob("*") if path.suffix in SUFFIXES)
    return [*ROOT.glob("*.md"), *inside]


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("a formula [Schlick94; BenArtzi07, eq. 3.10] of two", {"Schlick94", "BenArtzi07"}),
        ("over a line's\nend [Walter07,\neq. 25]", {"Walter07"}),
        ("x[Key00] [lower07] [glTF 2.0, B] [DESIGN.md, 11] [Ab123]", {"Key00"}),
    ],
)
def test_what_counts_as_a_citation(text: str, keys: set[str]) -> None:
    assert keys_cited(text) == keys


def test_every_source_that_is_cited_has_an_entry() -> None:
    cited = {path: keys_cited(path.read_text(encoding="utf-8")) for path in citing_files() if path != Path(__file__)}
    known = set(entries())
    missing = {str(path.relative_to(ROOT)): sorted(keys - known) for path, keys in cited.items() if keys - known}
    assert not missing
    assert "BenArtzi07" in set().union(*cited.values())  # the search finds something


def test_no_entry_stands_twice() -> None:
    assert len(entries()) == len(set(entries()))
