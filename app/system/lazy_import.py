"""Names of modules that are imported late, by one process alone, or run as a program of their own.

In a checkout the packages are `app`, `engine` and `ui`; a wheel installs them inside one package, `insitu`, see
`setup.py`. Names are written as in the checkout; `qualified` returns the name in the running program.
"""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path
from typing import Any

_OUTER = __name__.removesuffix("app.system.lazy_import")
# The folder that has to be in the import path.
IMPORT_FOLDER = Path(__file__).resolve().parents[2 + _OUTER.count(".")]


def qualified(module: str) -> str:
    """`app.worker` of a checkout; `insitu.app.worker` of an installed wheel."""
    return _OUTER + module


def program_environment() -> dict[str, str]:
    """The environment of a program that is run by a module's name: this process's, and the places from which it
    imports."""
    places = dict.fromkeys([str(IMPORT_FOLDER), *(place for place in sys.path if place)])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}


def import_named(name: str) -> Any:
    """The attribute that "module:attribute" names."""
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(qualified(module)), attribute)
