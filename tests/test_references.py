"""Citations in code, shaders, scenes and documents: their source is listed, the place and the page cited exist."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BIBLIOGRAPHY = ROOT / "docs" / "references.bib"
CITING = ("app", "assets", "benchmarks", "docs", "engine", "examples", "scripts", "shaders", "tests", "ui")
PLACES = tomllib.loads((ROOT / "tests" / "cited_places.toml").read_text(encoding="utf-8"))
WORDS = {"ch": "sections", "sect": "sections", "eq": "equations", "fig": "figures", "tab": "tables", "code": "codes"}
PLACES_OF_TABLES = [("sections", "8"), ("tables", "8.1"), ("tables", "8.3")]
WORD_OR_NUMBER = re.compile(r"\b(ch|sect|eq|fig|tab|code)(?:s|tions?|apters?|uations?|ures?|les?)?\b|\b\d+(?:\.\d+)*\b")
SUFFIXES = {".py", ".glsl", ".md", ".toml", ".sh"}


def keys_cited(text: str) -> set[str]:
    """Keys within brackets: name and two-digit year, alone or before a place; semicolons between several."""
    parts = (part.strip() for inside in re.findall(r"\[([^\[\]]*)\]", text) for part in inside.split(";"))
    return {found[1] for part in parts if (found := re.match(r"([A-Z][A-Za-z]+\d\d)(?:,|$)", part))}


def entries() -> list[str]:
    return re.findall(r"^@\w+\{(\w+),", BIBLIOGRAPHY.read_text(encoding="utf-8"), re.MULTILINE)


def citing_files() -> list[Path]:
    inside = (path for folder in CITING for path in (ROOT / folder).rglob("*") if path.suffix in SUFFIXES)
    return [*ROOT.glob("*.md"), *ROOT.glob("*.py"), *inside]


def places_cited(text: str) -> list[tuple[str, str, str]]:
    """(key, kind, number) of each number within brackets, such as ("Ma06", "figures", "7"); a bare one is a section."""
    found = []
    for part in (part for inside in re.findall(r"\[([^\[\]]*)\]", text) for part in inside.split(";")):
        cited = re.match(r"\W*([A-Z][A-Za-z]+\d\d),(.*)", part, re.DOTALL)
        kind = "sections"
        for match in WORD_OR_NUMBER.finditer(cited[2] if cited else ""):
            kind = WORDS[match[1]] if match[1] else kind
            if cited and not match[1]:
                found.append((cited[1], kind, match[0]))
    return found


def exists(key: str, kind: str, number: str) -> bool:
    """Whether a paper of `cited_places.toml` has that section, equation, figure, table or piece of code."""
    known = PLACES[key].get(kind, 0)
    if kind == "sections":
        return number in known
    chapter, _, place = number.rpartition(".")
    last = known.get(chapter, 0) if isinstance(known, dict) else 0 if chapter else known
    return 1 <= int(place) <= last


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


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("[BenArtzi07, eq. 3.1 and 4.16]", [("BenArtzi07", "equations", "3.1"), ("BenArtzi07", "equations", "4.16")]),
        ("over [Sloan05,\nfig. 1; Ma06, 3.1]", [("Sloan05", "figures", "1"), ("Ma06", "sections", "3.1")]),
        ("[BenArtzi07, ch. 8, tables 8.1 to 8.3]", [("BenArtzi07", *p) for p in PLACES_OF_TABLES]),
        ("[Ma06, 3.3: functions, not colours] [Ma06]", [("Ma06", "sections", "3.3")]),
    ],
)
def test_what_counts_as_a_place(text: str, places: list[tuple[str, str, str]]) -> None:
    assert places_cited(text) == places


@pytest.mark.parametrize(
    ("place", "there"),
    [
        (("BenArtzi07", "sections", "3.5"), True),
        (("BenArtzi07", "sections", "3.6"), False),  # chapter 3 ends with 3.5
        (("BenArtzi07", "equations", "4.19"), True),
        (("BenArtzi07", "equations", "4.20"), False),
        (("BenArtzi07", "figures", "2.1"), False),  # chapter 2 has none
        (("Ma06", "figures", "14"), True),
        (("Ma06", "figures", "3.1"), False),
        (("Sloan05", "tables", "1"), False),
    ],
)
def test_which_places_exist(place: tuple[str, str, str], there: bool) -> None:
    assert exists(*place) == there


def test_every_place_that_is_cited_exists() -> None:
    wrong, count = {}, 0
    for path in (path for path in citing_files() if path != Path(__file__)):
        places = [place for place in places_cited(path.read_text(encoding="utf-8")) if place[0] in PLACES]
        count += len(places)
        if missing := [" ".join(place) for place in places if not exists(*place)]:
            wrong[str(path.relative_to(ROOT))] = missing
    assert not wrong
    assert count > 100  # the search finds something


def test_every_page_that_is_cited_exists() -> None:
    """Code names pages by their path from the top, such as docs/orbit.md, in brackets or not."""
    wrong = {}
    for path in (path for path in citing_files() if path.suffix != ".md" and path != Path(__file__)):
        pages = re.findall(r"\[([\w./-]+\.md)\b|\b(docs/[\w./-]+\.md)\b", path.read_text(encoding="utf-8"))
        if missing := [page for page in map("".join, pages) if not (ROOT / page).exists()]:
            wrong[str(path.relative_to(ROOT))] = missing
    assert not wrong


def test_every_source_that_is_cited_has_an_entry() -> None:
    cited = {path: keys_cited(path.read_text(encoding="utf-8")) for path in citing_files() if path != Path(__file__)}
    known = set(entries())
    missing = {str(path.relative_to(ROOT)): sorted(keys - known) for path, keys in cited.items() if keys - known}
    assert not missing
    assert "BenArtzi07" in set().union(*cited.values())  # the search finds something


def test_no_entry_stands_twice() -> None:
    assert len(entries()) == len(set(entries()))
