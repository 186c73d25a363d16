"""What a page consists of: entries, and what they are carried out with."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from app.measure.report import save_figure
from assets.scripts.bounces import save

WIDTH = 120


@dataclass(frozen=True)
class Work:
    """Where an entry's pictures go, and how much it does.

    docs: the folder of the documentation; pictures of an entry go to its folder `papers`, those that guides show as
    well to `images`. quick: tiny pictures and few samples, to see that all works; report gets a line for each step.
    """

    docs: Path
    quick: bool
    report: Callable[[str], None]

    @property
    def papers(self) -> Path:
        return self.docs / "papers"

    @property
    def images(self) -> Path:
        return self.docs / "images"

    def of(self, full: int, quick: int) -> int:
        """A number of pixels, samples or frames."""
        return quick if self.quick else full

    def picture(self, name: str, pixels: NDArray[np.uint8], words: str) -> str:
        """Save a picture (H, W, 3) sRGB beside the page; the line that shows it."""
        save(self.papers / f"{name}.png", pixels)
        return f"![{words}]({name}.png)\n"

    def plot(self, name: str, figure: Figure, words: str) -> str:
        """Save a plot beside the page; the line that shows it."""
        save_figure(self.papers / f"{name}.png", figure)
        return f"![{words}]({name}.png)\n"


Make = Callable[[Work], str]


@dataclass(frozen=True)
class Entry:
    """A figure or table: its place in the paper, what it shows, and what the paper prints of it in words or numbers.

    make: carries ours out and returns it in Markdown; None where there is no counterpart, for the reason that `printed`
    gives. timed: ours has seconds, so the machine's load belongs to it.
    """

    place: str
    title: str
    printed: str
    make: Make | None = None
    timed: bool = False

    @property
    def name(self) -> str:
        """For files and the command line: "table 4.2" as "table-4.2"."""
        return self.place.replace(" ", "-").replace(",", "")


@dataclass(frozen=True)
class Paper:
    """One page. key: as in docs/references.bib."""

    key: str
    title: str
    entries: tuple[Entry, ...]

    @property
    def page(self) -> str:
        """The page's name, without its ending."""
        return self.key.lower()


def read_paper(key: str, makers: Mapping[str, Make]) -> Paper:
    """The paper whose entries stand in the file of its key here, with what carries them out, by place.

    Raises ValueError for a place that the file does not have.
    """
    with open(Path(__file__).with_name(f"{key.lower()}.toml"), "rb") as file:
        described = tomllib.load(file)
    entries = tuple(Entry(**each, make=makers.get(each["place"])) for each in described["entry"])
    if unknown := set(makers) - {each.place for each in entries}:
        raise ValueError(f"{key}: no entry {sorted(unknown)[0]!r}")
    return Paper(key, described["title"], entries)


def paragraph(text: str) -> str:
    """Text in lines of the width of all pages."""
    return (
        "\n".join(textwrap.wrap(" ".join(text.split()), WIDTH, break_long_words=False, break_on_hyphens=False)) + "\n"
    )
