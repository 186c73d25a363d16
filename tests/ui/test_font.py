"""The window's font has every character that the program's own texts have."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from fontTools.ttLib import TTFont

from engine.material import MODELS
from ui.panels.widgets import SUBSCRIPTS, subscripted
from ui.theme import fonts_folder

ROOT = Path(__file__).resolve().parents[2]


def characters(file: Path) -> set[str]:
    return set(map(chr, TTFont(file).getBestCmap()))


@pytest.fixture(scope="module")
def drawn() -> set[str]:
    icons = fonts_folder() / "Font_Awesome_6_Free-Solid-900.otf"
    return characters(fonts_folder() / "Roboto" / "Roboto-Regular.ttf") | characters(icons) | {"\n"}


def literals(file: Path) -> Iterator[str]:
    """The strings of a module that are no docstrings."""
    tree = ast.parse(file.read_text())
    documented = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            yield node.value


@pytest.mark.parametrize("folder", ["ui", "app/document", "app/editor", "app/operators", "engine/material"])
def test_every_text_can_be_drawn(folder: str, drawn: set[str]) -> None:
    texts = {text: file.name for file in (ROOT / folder).rglob("*.py") for text in literals(file)}
    missing = {text: name for text, name in texts.items() if set(text) - drawn - set(SUBSCRIPTS)}
    assert not missing


def test_parameters_are_labelled_in_characters_that_can_be_drawn(drawn: set[str]) -> None:
    for model in MODELS.values():
        for each in model.parameters:
            for text in (each.label, each.tooltip, *each.titles):
                assert set(subscripted(text)) <= drawn, (model.name, each.name, text)
