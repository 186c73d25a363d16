"""What values of files and command lines are."""

from __future__ import annotations

from typing import TypeGuard


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is a number, finite or not; a truth value is none."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)
