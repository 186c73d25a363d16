"""The typed errors of the project: every failure that a user can cause ends in one readable line.

A loader never passes on a traceback of a third-party library. It raises `LoadError`, which names the file, the place in
it, the value found and the range expected. `InsituError` is the common base class: code that shows errors to the user
catches it alone, and anything else is a bug. `plain_line` formats all lines for the user, whatever they contain:
messages when they are raised, other text where a terminal or the window shows it (`console.print_line`,
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
    """A failure with a one-line message for the user."""

    def __init__(self, line: str = "") -> None:
        super().__init__(plain_line(line))


class LoadError(InsituError):
    """A file that cannot be used: `FILE: WHAT = VALUE, expected RANGE; nothing was changed`.

    file: the file being read; what: the place in it ("object 2 'ball': transform", "line 17", "vertex 5"); value: the
    value found there, a string is shown as it is; expected: the accepted values.
    """

    def __init__(self, file: str | Path, what: str, value: object, expected: str) -> None:
        self.file, self.what, self.value, self.expected = str(file), what, value, expected
        line = f"{self.file}: {what} = {describe_value(value)}, expected {expected}; nothing was changed"
        super().__init__(line)

    @property
    def reason(self) -> str:
        """`WHAT = VALUE, expected RANGE`: for a warning about a part that is skipped while the rest of the file is
        used."""
        return f"{self.what} = {describe_value(self.value)}, expected {self.expected}"

    def __reduce__(self) -> tuple[type[LoadError], tuple[str, str, object, str]]:
        """Pickles the four parts, so that the line can be sent between processes."""
        return LoadError, (self.file, self.what, describe_value(self.value), self.expected)


def plain_line(text: str, keep_spaces: bool = False) -> str:
    """The text as one line of at most `LONGEST_LINE` printable characters; keep_spaces: for rows of a table, whose
    columns spaces align.

    A longer text is shortened to its beginning, which says where, and its end, which says what to do.
    """
    if len(text) > 4 * LONGEST_LINE:
        text = f"{text[: 2 * LONGEST_LINE]} … {text[-LONGEST_LINE:]}"
    text = _printable(text if keep_spaces else " ".join(text.split()))
    return text if len(text) <= LONGEST_LINE else f"{text[:_LONGEST_HEAD]} … {text[-_LONGEST_TAIL:]}"


def plain_notes(notes: Iterable[str]) -> tuple[str, ...]:
    """Notes as plain lines without duplicates; at most `MOST_NOTES`, followed by the number of further ones."""
    return first_notes(tuple(dict.fromkeys(map(plain_line, notes))))


def first_notes(lines: tuple[str, ...]) -> tuple[str, ...]:
    """The same for lines that are already plain."""
    n_more = len(lines) - MOST_NOTES
    return lines if n_more <= 0 else (*lines[:MOST_NOTES], f"and {n_more} more notes")


def printable_name(text: str, longest: int) -> str:
    """A name from a file in a form that can be shown, written and read back: printable, and shortened to `longest`."""
    text = _printable(" ".join(text[: 4 * longest].split()))
    return text if len(text) <= longest else text[: longest - 1] + "…"


def list_names(names: Iterable[str], most: int = 8) -> str:
    """Names in a line: the first ones, shortened, and how many more there are."""
    every = list(names)
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(map(describe_value, every[:most])) + more


def describe_value(value: object) -> str:
    """The value on one printable line of at most 80 characters."""
    text = _printable(value[: 2 * _LONGEST_VALUE] if isinstance(value, str) else repr(value))
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"


def _printable(text: str) -> str:
    """The text without characters that a terminal or a label would interpret: control characters and direction
    marks."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
