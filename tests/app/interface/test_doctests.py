"""What the interface's docstrings show is what happens."""

import doctest
import importlib

import pytest

MODULES = ("app.interface", "app.interface.nodes", "app.interface.scene")


@pytest.mark.parametrize("name", MODULES)
def test_docstrings_show_what_happens(name: str) -> None:
    module = importlib.import_module(name)
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert result.failed == 0


def test_there_are_some() -> None:
    found = [doctest.DocTestFinder().find(importlib.import_module(name)) for name in MODULES]
    assert sum(bool(each.examples) for tests in found for each in tests) >= 6
