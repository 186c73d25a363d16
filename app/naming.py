"""What is imported late, or by one process alone, is named "module:name" where it is listed."""

from __future__ import annotations

import importlib
from typing import Any


def named(name: str) -> Any:
    """What "module:name" names."""
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
