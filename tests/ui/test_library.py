"""The library and the clipboard by hand: a material dragged onto an object, kept, copied, pasted."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from app.files.materials import Library, measured_layers
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from ui.gl.brdf_views import sphere_picture
from ui.gl.gpu_memory import read_texture
from ui.gl.thumbnails import SIDE, Thumbnails, entry_picture
from ui.headless import HeadlessWindow


@pytest.fixture
def shelf(window: HeadlessWindow) -> HeadlessWindow:
    """A window whose library has been read."""
    window.frames(60)
    assert window.shell.actor.library.entries
    return window


def find(window: HeadlessWindow, words: str) -> None:
    """Type into the search field."""
    window.click_handle("library.search")
    window.type(words)
    window.frames(2)


def object_pixel(window: HeadlessWindow, name: str) -> tuple[float, float]:
    """A place on screen where the picture shows the object."""
    x, y = window.shell.handle_position("viewport.corner")
    source = window.shell.source
    assert source is not None and source.picture is not None
    centre_x, centre_y = window.shell.handle_position("viewport.centre")
    scale = 2.0 * (centre_x - x) / source.picture.width
    places = ((c, r) for r in range(source.picture.height) for c in range(source.picture.width))
    column, row = next(place for place in places if source.object_at(*place) == name)
    return x + (column + 0.5) * scale, y + (row + 0.5) * scale


def test_a_material_dragged_onto_an_object_becomes_its_own(shelf: HeadlessWindow) -> None:
    editor = shelf.shell.editor
    find(shelf, "metals gold")
    shown = [name for name in shelf.shell.handles.names() if name.startswith("library.")]
    assert "library.Gold" in shown and "library.Silver" not in shown and "library.category.Cloth" not in shown
    before = editor.document
    x, y = shelf.shell.handle_position("viewport.centre")
    shelf.drag(shelf.shell.handle_position("library.Gold"), (x, 4.0))  # past all objects
    assert editor.document is before
    shelf.drag(shelf.shell.handle_position("library.Gold"), object_pixel(shelf, "tray"))
    assert [layer.name for layer in editor.document.object("tray").layers] == ["metal"]
    assert editor.view.selected is not None and editor.view.selected.object == "tray"
    assert editor.undo() == "Gold on tray" and editor.document == before


def test_the_selected_material_is_kept_under_a_name(shelf: HeadlessWindow) -> None:
    editor = shelf.shell.editor
    shelf.click_handle("button.library.add")
    shelf.frames(3)
    shelf.type("My pot")
    shelf.key(imgui.Key.enter)
    shelf.frames(2)
    assert Library().entry("My pot").material.layers == editor.document.object("teapot").layers


def test_materials_and_curves_are_copied_and_pasted_with_keys(shelf: HeadlessWindow) -> None:
    editor, ctrl, shift = shelf.shell.editor, imgui.Key.mod_ctrl, imgui.Key.mod_shift
    tray = editor.document.object("tray").layers
    shelf.key(imgui.Key.c, ctrl, shift)
    editor.select("tray.0")
    assert editor.view.selected is not None and editor.view.selected.factor is not None
    shelf.frames(1)
    shelf.key(imgui.Key.v, ctrl)
    found = editor.document.layer("tray.0").coefficients(editor.view.selected.factor, 16)
    assert found == pytest.approx(editor.document.layer("teapot.1").coefficients("theta_h", 16), rel=1e-3, abs=1e-3)
    editor.undo()

    editor.select("teapot")
    shelf.frames(1)
    shelf.key(imgui.Key.c, ctrl)
    editor.select("tray")
    shelf.frames(1)
    shelf.key(imgui.Key.v, ctrl, shift)
    copied = editor.document.object("teapot").layers
    assert editor.document.object("tray").layers[len(tray) :] == copied
    shelf.key(imgui.Key.v, ctrl)
    assert editor.document.object("tray").layers == copied

    before = editor.document
    imgui.set_clipboard_text("a shopping list")
    shelf.key(imgui.Key.v, ctrl)
    assert editor.document is before
    assert "a material that was copied" in editor.status.message


def test_pictures_of_materials_are_what_would_be_drawn_now(context: moderngl.Context) -> None:
    library = Library()
    for name in ("Gold", "Velvet, red", "Plastic, red"):
        entry = library.entry(name)
        file = entry_picture(entry)
        assert file is not None, f"{entry.path} has no picture: python -m ui.gl.thumbnails makes it"
        there = np.asarray(Image.open(file).convert("RGBA")).astype(float)
        drawn = sphere_picture(context, entry.material.layers, SIDE)
        assert np.abs(there - drawn).mean() < 3.0, f"{file} is outdated: python -m ui.gl.thumbnails makes it anew"
    assert all(entry_picture(entry) for entry in library.entries)


def test_own_measured_materials_wait_for_what_was_measured(context: moderngl.Context) -> None:
    # What `complete` says of their layers is drawn, once it says something.
    even = make_layer(MODELS["lambert"], {"albedo": 1.0})
    ready: list[tuple[Layer, ...] | None] = [None]
    library, thumbnails = Library(), Thumbnails(context, complete=lambda layers: ready[0])
    entry = library.save("Cloth", measured_layers(Path("/cloth.binary"), cloth=True))
    assert thumbnails.texture(entry) is None and not thumbnails.is_waiting
    assert not thumbnails.step(may_draw=True)
    ready[0] = (even,)
    while thumbnails.is_waiting:
        thumbnails.step(may_draw=True)
    drawn = thumbnails.texture(entry)
    assert drawn is not None
    there = read_texture(drawn, np.uint8).astype(float)
    assert np.abs(there - sphere_picture(context, (even,), SIDE)).mean() < 1.0
    thumbnails.release()


def test_own_materials_are_drawn_when_there_is_time(context: moderngl.Context) -> None:
    library, thumbnails = Library(), Thumbnails(context)
    entry = library.save("Mine", library.entry("Gold").material.layers)
    assert thumbnails.texture(entry) is None and thumbnails.is_waiting
    assert not thumbnails.step(may_draw=False)
    while thumbnails.is_waiting:
        thumbnails.step(may_draw=True)
    drawn, builtin = thumbnails.texture(entry), Image.open(library.entry("Gold").path.with_suffix(".png"))
    assert drawn is not None
    there = read_texture(drawn, np.uint8).astype(float)
    assert np.abs(there - np.asarray(builtin.convert("RGBA"))).mean() < 3.0
    thumbnails.release()


def test_what_is_said_of_a_material_keeps_clear_of_its_border(shelf: HeadlessWindow) -> None:
    shelf.move(*shelf.shell.handle_position("library.Terracotta"))
    shelf.frames(60)  # a second at rest
    padding = imgui.internal.find_window_by_name("##Tooltip_00").window_padding
    assert padding.x > 0 and padding.y > 0
