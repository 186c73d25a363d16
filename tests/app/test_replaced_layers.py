"""Layers that take the place of others: whatever stood there before, the talk with the worker goes on from it."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest

from app.document.commands.layers import SetMaterial, SetModel
from app.editor.editor import Editor
from app.files.materials import Library, LibraryEntry
from app.modes.placement.desired_state import same_coefficients
from engine.material import MODELS
from tests.app.fake_worker import ServingClient
from tests.app.modes.placement.test_transport_controller import Renderer, settle


def all_pairs(names: list[str]) -> Iterator[str]:
    """A closed walk over the names on which each follows each other one exactly once."""
    yield names[0]
    for i in range(len(names)):
        for later in names[i + 1 :]:
            yield from (later, names[i])
        if i + 1 < len(names):
            yield names[i + 1]


@pytest.fixture(scope="module")
def shipped() -> dict[str, LibraryEntry]:
    library = Library()
    library.read_all()
    return {entry.name: entry for entry in library.entries if not entry.is_own}


def test_the_walk_takes_every_pair() -> None:
    names = list("abcde")
    assert len({(a, b) for a, b in pairwise(all_pairs(names)) if a != b}) == 5 * 4


def two_of_a_kind(shipped: dict[str, LibraryEntry]) -> list[str]:
    """Names of materials, two at most whose layers have the same models and the same edits: these differ in numbers."""
    kinds: dict[object, list[str]] = {}
    for name, entry in sorted(shipped.items()):
        layers = entry.material.layers
        kind = tuple((each.model.name, each.rises, tuple(factor for factor, _ in each.edits)) for each in layers)
        kinds.setdefault(kind, []).append(name)
    assert len(kinds) >= 13
    return [name for names in kinds.values() for name in names[:2]]


@pytest.mark.parametrize("chosen", [two_of_a_kind, pytest.param(sorted, marks=pytest.mark.sweep)])
def test_any_material_of_the_library_follows_any_other(
    shipped: dict[str, LibraryEntry], chosen: Callable[[dict[str, LibraryEntry]], list[str]]
) -> None:
    names = chosen(shipped)
    editor = Editor(ServingClient(3), "shelf")
    renderer = Renderer(editor)
    now = settle(editor, renderer, 0.0)
    for before, name in pairwise(all_pairs(names)):
        assert editor.do(SetMaterial("pot", shipped[name].material.layers)) is None, (before, name)
        now = settle(editor, renderer, now)
        for key, _ in editor.document.layers():
            assert same_coefficients(renderer.shown[key], editor.controller.picture.wanted_coefficients(key)), (
                before,
                name,
                key,
            )


@pytest.mark.parametrize("first", sorted(MODELS))
def test_any_model_follows_any_other_by_undo_and_redo(first: str) -> None:
    editor = Editor(ServingClient(5), "shelf")
    renderer = Renderer(editor)
    now = settle(editor, renderer, 0.0)
    for model in sorted(MODELS):
        editor.do(SetModel("pot.1", first))
        now = settle(editor, renderer, now)
        editor.do(SetModel("pot.1", model))
        renderer.frame(now := now + 0.3)  # in mid-computation
        for step in (editor.undo, editor.redo):
            step()
            now = settle(editor, renderer, now)
