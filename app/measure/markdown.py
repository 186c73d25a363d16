"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence


def table(head: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    """A table under a line of names, the first column to the left and all others to the right."""
    marks = ["---", *["---:"] * (len(head) - 1)]
    return "".join(_line(cells) for cells in (head, marks, *lines))


def _line(cells: Sequence[object]) -> str:
    escaped = (str(cell).replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |\n"
