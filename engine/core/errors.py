"""The typed errors of the project: every failure a person can cause ends in one readable line.

A loader never lets a traceback of a foreign library through; it raises `LoadError`, which names the file, the thing in
it, the value found and the range expected. `InsituError` is the common ancestor: whoever shows errors to a person
catches it alone, anything else is a defect of ours. Lines for a person are made by `plain_line`, whatever is in them:
messages when they are raised, what else a terminal or the window shows where it is shown (`console.print_line`,
`StatusMetrics`).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

_LONGEST_VALUE = 80
MOST_NOTES = 24
_LONGEST_HEAD, _LONGEST_TAIL = 300, 190
LONGEST_LINE = _LONGEST_HEAD + _LONGEST_TAIL + 3


class InsituError(Exception):
    """A failure with a one-line message meant for a person."""

    def __init__(self, line: str = "") -> None:
        super().__init__(plain_line(line))


class LoadError(InsituError):
    """A file that cannot be used: `FILE: WHAT = VALUE, expected RANGE; nothing was changed`.

    file: the file being read; what: the place in it ("object 2 'ball': transform", "line 17", "vertex 5");
    value: what was found there, a string is shown as it is; expected: what would have been accepted.
    """

    def __init__(self, file: str | Path, what: str, value: object, expected: str) -> None:
        self.file, self.what, self.value, self.expected = str(file), what, value, expected
        line = f"{self.file}: {what} = {describe_value(value)}, expected {expected}; nothing was changed"
        super().__init__(line)

    @property
    def reason(self) -> str:
        """`WHAT = VALUE, expected RANGE`: for a note on what is left out instead of refusing the file."""
        return f"{self.what} = {describe_value(self.value)}, expected {self.expected}"

    def __reduce__(self) -> tuple[type[LoadError], tuple[str, str, object, str]]:
        """Pickled by its four parts, so that the line survives the way between processes."""
        return LoadError, (self.file, self.what, describe_value(self.value), self.expected)


def plain_line(text: str, keep_spaces: bool = False) -> str:
    """The text as one line of at most `LONGEST_LINE` printable characters; keep_spaces: of a table, whose columns are
    aligned by them.

    Of a longer one its beginning, which says where, and its end, which says what to do, are kept.
    """
    if len(text) > 4 * LONGEST_LINE:
        text = f"{text[: 2 * LONGEST_LINE]} … {text[-LONGEST_LINE:]}"
    text = _printable(text if keep_spaces else " ".join(text.split()))
    return text if len(text) <= LONGEST_LINE else f"{text[:_LONGEST_HEAD]} … {text[-_LONGEST_TAIL:]}"


def plain_notes(notes: Iterable[str]) -> tuple[str, ...]:
    """Notes as plain lines, each once; of more than `MOST_NOTES` the first, and how many more there are."""
    return first_notes(tuple(dict.fromkeys(map(plain_line, notes))))


def first_notes(lines: tuple[str, ...]) -> tuple[str, ...]:
    """The same of lines that are plain already."""
    n_more = len(lines) - MOST_NOTES
    return lines if n_more <= 0 else (*lines[:MOST_NOTES], f"and {n_more} more notes")


def printable_name(text: str, longest: int) -> str:
    """A name that a file gives, so that it can be shown, written and read back: printable, and cut where longer."""
    text = _printable(" ".join(text[: 4 * longest].split()))
    return text if len(text) <= longest else text[: longest - 1] + "…"


def describe_value(value: object) -> str:
    """The value on one printable line of at most 80 characters."""
    text = _printable(value[: 2 * _LONGEST_VALUE] if isinstance(value, str) else repr(value))
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"


def _printable(text: str) -> str:
    """Without what a terminal or a label would act upon: control characters, marks that turn the direction round."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
