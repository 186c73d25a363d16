"""docs/papers/: a page a paper, from what was carried out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.measure.study import load_average
from app.system.atomic import save_file
from benchmarks.papers import thesis, triple_product, zonal_harmonics
from benchmarks.papers.entries import Entry, Paper, Work, paragraph, read_paper

PAPERS = (
    read_paper("BenArtzi07", thesis.MAKERS),
    read_paper("Ma06", triple_product.MAKERS),
    read_paper("Sloan05", zonal_harmonics.MAKERS),
)


@dataclass(frozen=True)
class Kept:
    """Texts of entries in a folder, a file each, so that a run can be continued and a part of it repeated."""

    folder: Path

    def file(self, paper: Paper, entry: Entry) -> Path:
        return self.folder / paper.page / f"{entry.name}.md"

    def text(self, paper: Paper, entry: Entry) -> str:
        """The text, or that there is none."""
        file = self.file(paper, entry)
        return file.read_text(encoding="utf-8") if file.exists() else "Not carried out in this run.\n"

    def save(self, paper: Paper, entry: Entry, text: str) -> None:
        file = self.file(paper, entry)
        file.parent.mkdir(parents=True, exist_ok=True)
        save_file(file, text.encode())


def chosen(only: Sequence[str]) -> Iterable[tuple[Paper, Entry]]:
    """The entries that are carried out: all, or those whose page and name are named, such as "ma06/table-3"."""
    for paper in PAPERS:
        for entry in paper.entries:
            if entry.make is not None and (not only or paper.page in only or f"{paper.page}/{entry.name}" in only):
                yield paper, entry


def carry_out(work: Work, kept: Kept, only: Sequence[str], conditions: str) -> None:
    """Carry out entries and write all pages. conditions: a sentence on the machine."""
    work.papers.mkdir(parents=True, exist_ok=True)
    work.images.mkdir(parents=True, exist_ok=True)
    for paper, entry in chosen(only):
        assert entry.make is not None
        work.report(f"[{paper.key}] {entry.place}: {entry.title}")
        load = load_average() if entry.timed else None
        text = entry.make(work)
        said = "" if load is None else f"\nLoad {load[0]:.1f} when it began, with what this run did before.\n"
        kept.save(paper, entry, text + said)
    write_pages(work.papers, kept, conditions)


def write_pages(folder: Path, kept: Kept, conditions: str) -> None:
    """All pages from what is kept."""
    for paper in PAPERS:
        save_file(folder / f"{paper.page}.md", page(paper, kept, conditions).encode())


def page(paper: Paper, kept: Kept, conditions: str) -> str:
    """One page, in Markdown."""
    head = f"""Figures and tables of [{paper.key}], *{paper.title}*, in their order, and ours beside them;
        `python -m benchmarks.papers` writes this page. {conditions}"""
    parts = [f"# [{paper.key}] beside ours\n", paragraph(head)]
    for entry in paper.entries:
        if entry.make is not None:
            parts += [
                f"## {entry.place[0].upper()}{entry.place[1:]}: {entry.title}\n",
                paragraph(f"Printed: {entry.printed}"),
            ]
            parts.append(kept.text(paper, entry))
    none = [entry for entry in paper.entries if entry.make is None]
    parts.append("## Without a counterpart\n")
    parts.append("".join(f"- {entry.place}, {entry.title}: {_lowered(entry.printed)}\n" for entry in none))
    return "\n".join(parts)


def _lowered(text: str) -> str:
    return text if text[:1].isupper() and text[1:2].isupper() else text[0].lower() + text[1:]


def conditions_of(facts: dict[str, Any]) -> str:
    """What machine a run was on."""
    machine = f"{facts['cores']} cores of {facts['cpu']}, {facts['ram_gib']:.0f} GiB"
    return f"Measured on {facts['date'][:10]} with {machine}."
