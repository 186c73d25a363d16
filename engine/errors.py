"""The typed errors of the project: every failure a person can cause ends in one readable line.

A loader never lets a traceback of a foreign library through; it raises `LoadError`, which names the file, the thing in
it, the value found and the range expected. `InsituError` is the common ancestor: whoever shows errors to a person
catches it alone, anything else is a defect of ours.
"""

from __future__ import annotations

from pathlib import Path

_LONGEST_VALUE = 80


class InsituError(Exception):
    """A failure with a one-line message meant for a person."""


class LoadError(InsituError):
    """A file that cannot be used: `FILE: WHAT = VALUE, expected RANGE; nothing was changed`.

    file: the file being read; what: the place in it ("object 2 'ball': transform", "line 17", "vertex 5");
    value: what was found there, a string is shown as it is; expected: what would have been accepted.
    """

    def __init__(self, file: str | Path, what: str, value: object, expected: str) -> None:
        self.file, self.what, self.value, self.expected = str(file), what, value, expected
        line = f"{self.file}: {what} = {describe_value(value)}, expected {expected}; nothing was changed"
        super().__init__(line)

    def __reduce__(self) -> tuple[type[LoadError], tuple[str, str, object, str]]:
        """Pickled by its four parts, so that the line survives the way between processes."""
        return LoadError, (self.file, self.what, describe_value(self.value), self.expected)


def describe_value(value: object) -> str:
    """The value on one printable line of at most 80 characters."""
    text = value if isinstance(value, str) else repr(value)
    text = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"
