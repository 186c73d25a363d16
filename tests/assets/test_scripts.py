"""The scripts that come with the program fit the scenes that come with it."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands.light import SetRotation
from app.document import resolve
from app.project import open_project
from app.script import Capture, DragItem, RedoSteps, Rotate, SelectPath, SetValues, UndoSteps, load_script
from app.set_path import set_path
from engine.scene.builtin import ASSETS


@pytest.mark.parametrize(
    ("script", "scene"),
    [("tour", "teatray"), ("readme", "teatray"), ("brdf", "teatray"), ("earrings", "earrings"), ("plate", "plate")],
)
def test_scripts_name_what_their_scenes_have(script: str, scene: str, tmp_path: Path) -> None:
    document = open_project(scene, (16, 16)).document
    for step in load_script(ASSETS / "scripts" / f"{script}.toml", tmp_path):
        if isinstance(step, SelectPath):
            assert resolve(document, step.path).kind == "factor"
        if isinstance(step, SetValues):
            for path, value in step.values:
                document = set_path(document, path, value).apply(document)
        if isinstance(step, Rotate):
            document = SetRotation(step.degrees).apply(document)


def test_the_tour_takes_back_what_it_does(tmp_path: Path) -> None:
    steps = load_script(ASSETS / "scripts" / "tour.toml", tmp_path)
    n_edits = sum(isinstance(step, DragItem | SetValues | Rotate) for step in steps)
    (undone,) = [step.count for step in steps if isinstance(step, UndoSteps)]
    (redone,) = [step.count for step in steps if isinstance(step, RedoSteps)]
    # Everything is taken back, a part of it done again.
    assert n_edits == undone > redone
    pictures = [step.path for step in steps if isinstance(step, Capture)]
    assert len(pictures) == len(set(pictures)) >= 6 and all(path.parent == tmp_path for path in pictures)
