"""Surfaces for Deform in the document: said by paths, kept by sessions, taken back, and refused in a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.document.commands import SetSurface
from app.document.document import Document, document_from_description
from app.document.view_state import ViewState
from app.files.session import fit_session, load_session, save_session
from app.project.set_path import set_path
from engine.core.errors import InsituError
from engine.scene.description import SceneDescription
from engine.scene.surface_kinds import NO_SURFACE, SURFACES, DeformSurface
from tests.ui.stand_in import SCENE


@pytest.fixture
def scene() -> Document:
    return document_from_description("stand-in", SceneDescription.model_validate(SCENE))


def having(document: Document, *said: tuple[str, Any]) -> DeformSurface:
    """The teapot's surface after these."""
    for path, value in said:
        document = set_path(document, f"teapot.{path}", value).apply(document)
    return document.object("teapot").surface


@pytest.mark.parametrize("kind", SURFACES)
def test_an_object_becomes_of_a_kind_and_back(scene: Document, kind: str) -> None:
    surface = having(scene, ("surface", kind))
    assert surface.kind == kind
    assert set(SURFACES[kind].defaults) <= set(surface.values)
    assert having(scene, ("surface", kind), ("surface", "none")) == NO_SURFACE


def test_a_value_makes_it_of_its_kind_and_leaves_the_others(scene: Document) -> None:
    found = having(scene, ("subsurface.scattering", 900.0), ("subsurface.ior", 1.5))
    assert found.values == {"scattering": 900.0, "absorption": 0.5, "ior": 1.5}
    found = having(scene, ("patch.kind", "swirl"), ("patch.repeats", 3))
    assert found.values == {"kind": "swirl", "file": None, "repeats": (3.0, 3.0), "height": 1.0}
    found = having(scene, ("patch.kind", "swirl"), ("patch.file", "heights.png"))
    assert (found.values["kind"], found.values["file"]) == (None, "heights.png")


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("teapot.surface", "fur", "none, membrane"),
        ("teapot.membrane", 0.5, "membrane.translucency"),
        (
            "teapot.membrane.translucency",
            2.0,
            "teapot: membrane: translucency = 2.0, expected a number from 0 to 1, or",
        ),
        ("teapot.membrane.thickness", 2.0, "translucency"),
        ("teapot.subsurface.ior", "glass", "ior"),
        ("teapot.patch.repeats", [1, 0], "repeats"),
        ("teapot.patch.kind", "knit", "'bumps'"),
        ("lamp.membrane.translucency", 0.5, "is an emitter"),
    ],
)
def test_what_makes_no_sense_is_one_line(scene: Document, path: str, value: Any, said: str) -> None:
    with pytest.raises(InsituError, match=said) as error:
        set_path(scene, path, value).apply(scene)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", ["", *SURFACES])
def test_a_session_keeps_it(scene: Document, kind: str, tmp_path: Path) -> None:
    owned = scene.with_object(SetSurface("tray", "wrinkles").apply(scene).object("tray"))
    tray = owned.object("tray")
    scene = scene.with_object(type(tray)(**{**vars(tray), "own_surface": tray.surface, "new_surface": None}))
    edited = SetSurface("tray", kind).apply(scene)
    path = save_session(tmp_path / "kept.insitu", edited, ViewState())
    again = fit_session(load_session(path), scene, str(path))
    assert again.object("tray").surface == edited.object("tray").surface
    assert [name for name, _ in again.new_surfaces] == ([] if kind == "wrinkles" else ["tray"])
