"""The documentation site: pages from outside docs/ get links that hold in it, and broken links are found."""

import re
from pathlib import Path

import pytest

from scripts import build_docs

ROOT = Path(__file__).resolve().parents[1]


def test_links_of_moved_pages_hold() -> None:
    text = build_docs.with_links(ROOT / "README.md")
    assert "](guides/materials.md)" in text  # docs/guides/materials.md, seen from index.md
    assert "](contributing.md)" in text
    assert "](contributing.md)" in build_docs.with_links(ROOT / "docs" / "architecture.md")
    assert "](../reference/command-line.md)" in build_docs.with_links(ROOT / "docs" / "guides" / "command-line.md")


@pytest.mark.parametrize(
    ("link", "is_broken"),
    [("b.html", False), ("b.html#there", False), ("b.html#gone", True), ("c.html", True), ("https://x.org", False)],
)
def test_broken_links_are_found(tmp_path: Path, link: str, is_broken: bool) -> None:
    (tmp_path / "a.html").write_text(f'<a href="{link}">')
    (tmp_path / "b.html").write_text('<h2 id="there">')
    assert build_docs.broken_links(tmp_path) == ([f"a.html: {link}"] if is_broken else [])


def test_the_menu_has_every_page() -> None:
    menu = (ROOT / "docs" / "zensical.toml").read_text()
    listed = re.findall(r'= "([\w/-]+\.md)"', menu)
    pages = [path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")]
    assert sorted(listed) == sorted([*pages, *build_docs.OUTSIDE.values()])
