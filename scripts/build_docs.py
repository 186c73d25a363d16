"""Builds the documentation site: `make docs`, or `.venv/bin/python -m scripts.build_docs FOLDER`.

Pages outside docs/ (README, CONTRIBUTING, CHANGELOG, the origin of assets) join those inside in one folder, with their
links adjusted; Zensical makes HTML of it, and a warning of it is an error. Then each link of the HTML has to lead to a
file of the site and, where it names one, to an anchor there. Nothing is fetched: the pages work without a network.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
# Where pages from outside docs/ stand in the site.
OUTSIDE = {
    ROOT / "README.md": "index.md",
    ROOT / "CONTRIBUTING.md": "contributing.md",
    ROOT / "CHANGELOG.md": "changelog.md",
    ROOT / "assets" / "README.md": "assets.md",
}
LINK = re.compile(r"(\]\()([^)\s#]+)(#[^)\s]*)?(\))")


def place_of(path: Path) -> str | None:
    """A file's path in the site, None where it is no part of it."""
    if path in OUTSIDE:
        return OUTSIDE[path]
    return path.relative_to(DOCS).as_posix() if path.is_relative_to(DOCS) else None


def with_links(page: Path) -> str:
    """The page's text with links that hold in the site; those to files outside it become plain text."""
    own = Path(place_of(page) or "").parent

    def moved(found: re.Match[str]) -> str:
        target = found[2]
        if "://" in target:
            return found[0]
        place = place_of((page.parent / target).resolve())
        up = "../" * len(own.parts)
        return found[0] if place is None else f"{found[1]}{up}{place}{found[3] or ''}{found[4]}"

    return LINK.sub(moved, page.read_text(encoding="utf-8"))


def stage(folder: Path) -> None:
    """Copy pages and pictures into a folder, as the site has them."""
    for path in [*OUTSIDE, *sorted(DOCS.rglob("*"))]:
        place = place_of(path)
        if place is None or path.suffix not in (".md", ".png", ".jpg", ".bib", ".css"):
            continue
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            target.write_text(with_links(path), encoding="utf-8")
        else:
            shutil.copyfile(path, target)


def broken_links(site: Path) -> list[str]:
    """Links of the site's pages that lead to no file or no anchor of it."""
    texts = {page: page.read_text(encoding="utf-8") for page in sorted(site.rglob("*.html"))}
    anchors = {page: set(re.findall(r'\bid="?([^"\s>]+)', text)) for page, text in texts.items()}
    broken = []
    for page, text in texts.items():
        for target in re.findall(r'\b(?:href|src)="?([^"\s>]+)', text):
            if re.match(r"[a-z]+:|//", target) or page.name == "404.html":
                continue
            path, _, anchor = unquote(target).partition("#")
            found = (page.parent / path).resolve() if path else page
            found = found / "index.html" if found.is_dir() else found
            if not found.exists() or (anchor and found in anchors and anchor not in {*anchors[found], "__top"}):
                broken.append(f"{page.relative_to(site)}: {target}")
    return broken


def build(out: Path) -> list[str]:
    """Build the site in `out`/site; what is wrong with it, line by line."""
    source, site = out / "docs", out / "site"
    for folder in (source, site):
        shutil.rmtree(folder, ignore_errors=True)
    stage(source)
    shutil.copyfile(DOCS / "zensical.toml", out / "zensical.toml")
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean", "-f", str(out / "zensical.toml")]
    done = subprocess.run(command, capture_output=True, text=True)
    said = f"{done.stdout}\n{done.stderr}"
    warnings = [line for line in said.splitlines() if re.search(r"warning|error", line, re.IGNORECASE)]
    if done.returncode or warnings:
        return [said.strip()]
    return broken_links(site)


if __name__ == "__main__":
    out = Path(sys.argv[1]).resolve()
    problems = build(out)
    print(*problems, sep="\n", end="\n" if problems else "")
    print(f"{out / 'site' / 'index.html'}: {len(list((out / 'site').rglob('*.html')))} pages")
    sys.exit(bool(problems))
