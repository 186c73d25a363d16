"""docs/reference/formats.md names what the readers take, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

from app.document.sources import LIGHT_ENDINGS, PICTURE_ENDINGS, SCENE_ENDINGS, SESSION_ENDING
from engine.curve.table_text import TABLE_ENDINGS
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from engine.scene.loaders.formats import _READERS

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "reference" / "formats.md").read_text(encoding="utf-8")
LOADERS = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "engine" / "scene" / "loaders").glob("*.py"))
EXTENSION = r"\b(?:KHR|EXT)_[a-zA-Z_]*[a-z]\b"


def first_column(heading: str) -> list[str]:
    """The code in the first cells of a section's table."""
    section = PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    cells = [row.split("|")[1] for row in section.splitlines() if row.startswith("| `")]
    return [code for cell in cells for code in re.findall(r"`([^`]+)`", cell)]


def test_every_suffix_is_on_the_page() -> None:
    taken = {*SCENE_ENDINGS, SESSION_ENDING, *LIGHT_ENDINGS, *PICTURE_ENDINGS, *MEASURED_ENDINGS, *TABLE_ENDINGS}
    assert set(_READERS) <= taken
    listed = first_column("Files by suffix")
    assert sorted(listed) == sorted({*listed}) and set(listed) == taken


def test_every_extension_of_gltf_that_is_read_is_on_the_page() -> None:
    read = set(re.findall(EXTENSION, LOADERS))
    assert read and read <= set(re.findall(EXTENSION, PAGE))


def test_every_property_says_what_becomes_of_it() -> None:
    sections = re.split(r"\n## ", PAGE)[1:]
    tables = [section for section in sections if "| property | what becomes of it | how |" in section]
    rows = [row for table in tables for row in table.splitlines() if row.startswith("| ")]
    said = {row.split("|")[2].strip() for row in rows} - {"what becomes of it", "---", ""}
    assert len(tables) > 2 and said <= {"shown", "in part", "listed"} and len(said) > 1
