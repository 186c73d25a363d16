"""The picture in a file: as shown in PNG of 8 and 16 bits, linear in EXR, written by a thread, whole or not there."""

from __future__ import annotations

import io
import struct
import threading
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from imgui_bundle import imgui
from PIL import Image

from app.document.commands.light import SetBackground, SetIntensity
from app.document.document import Document
from app.document.view_state import SetView, ViewState
from app.stills.layer_saver import LayerSaver
from engine.light.radiance_files import read_radiance_image
from engine.render.display import deep_png
from tests.ui.real_window import RealWindow, real_window_fixture
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.panels.actions import SavePicture
from ui.picture_feed import PictureFeed, ViewportStill
from ui.picture_saving import StillSaver

real = real_window_fixture()


def read_deep(data: bytes) -> np.ndarray:
    """A slow reader of what `deep_png` writes: (H,W,3) of 16 bits."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        name, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length]) == (zlib.crc32(name + body),)
        chunks[name] = body
        at += 12 + length
    width, height, depth, kind, *rest = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    assert (depth, kind, rest) == (16, 2, [0, 0, 0])
    stream, rows = zlib.decompress(chunks[b"IDAT"]), []
    above = [0] * (6 * width)
    for row in range(height):
        line = stream[row * (6 * width + 1) :][: 6 * width + 1]
        assert line[0] == 2
        above = [(byte + up) % 256 for byte, up in zip(line[1:], above, strict=True)]
        rows.append(bytes(above))
    return np.frombuffer(b"".join(rows), ">u2").reshape(height, width, 3).astype(int)


def pixels_of(file: Path) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(file.read_bytes())))


def test_sixteen_bits_are_kept_and_others_read_them() -> None:
    values = np.random.default_rng(1).uniform(-0.1, 1.1, (7, 5, 3))
    data = deep_png(values)
    expected = np.round(65535 * np.clip(values, 0, 1)).astype(int)
    np.testing.assert_array_equal(read_deep(data), expected)
    # Pillow reads the upper eight.
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(data)).convert("RGB")), expected // 256)


def saved(window: HeadlessWindow, path: Path, deep: bool = False) -> bytes:
    """The bytes that come of saving the picture."""
    window.shell.request(SavePicture(path, deep))
    window.frame()
    assert window.run_until(lambda: window.shell.editor.status.message == f"saved {path}", 60.0), path
    return path.read_bytes()


def renderer_of(window: HeadlessWindow) -> PictureFeed:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source


@pytest.mark.gl
def test_png_is_what_is_shown_without_what_is_drawn_over_it(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(exposure=-0.7, hovered="tray", compare=editor.document, compare_divider=0.4))
    window.frames(2)
    picture = np.asarray(Image.open(io.BytesIO(saved(window, tmp_path / "a.png"))))
    deep = read_deep(saved(window, tmp_path / "b.png", deep=True))
    assert picture.shape == deep.shape == (HEIGHT, WIDTH, 3)
    editor.do(SetView.of(hovered=None, compare=None))
    editor.select(None)
    window.frames(2)
    shown = renderer_of(window).source.renderer.display_image()
    # One level apart at most: the screen's rounding is the graphics card's.
    assert np.abs(picture.astype(int) - shown).max() <= 1
    assert np.abs(deep / 257.0 - shown).max() <= 1.0
    assert len(np.unique(deep)) > 256


@pytest.mark.gl
def test_exr_is_linear_light_whatever_the_view(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    linear = renderer_of(window).source.renderer.linear_image()
    editor.do(SetView.of(exposure=2.0, tone_mapping="linear"))
    editor.do(SetIntensity(3.0))
    window.frames(2)
    saved(window, tmp_path / "c.exr")
    np.testing.assert_allclose(read_radiance_image(tmp_path / "c.exr"), 3.0 * linear, rtol=1e-6)


@pytest.mark.gl
def test_over_a_transparent_background_both_have_alpha(window: HeadlessWindow, tmp_path: Path) -> None:
    window.shell.editor.do(SetBackground("transparent"))
    window.shell.editor.do(SetIntensity(3.0))
    window.frames(2)
    with_alpha = renderer_of(window).source.renderer.linear_image_with_alpha()
    picture = np.asarray(Image.open(io.BytesIO(saved(window, tmp_path / "a.png"))))
    saved(window, tmp_path / "b.png", deep=True)
    assert picture.shape == (HEIGHT, WIDTH, 4)
    assert np.array_equal(picture[..., 3], np.round(255.0 * with_alpha[..., 3]))
    saved(window, tmp_path / "c.exr")
    channels = OpenEXR.File(str(tmp_path / "c.exr"), separate_channels=True).channels()
    found = np.stack([channels[name].pixels for name in "RGBA"], axis=2)
    np.testing.assert_allclose(found, with_alpha * (3.0, 3.0, 3.0, 1.0), rtol=1e-6)
    # The same pixels in 16 bits.
    deep = np.asarray(Image.open(tmp_path / "b.png"))
    assert deep.shape == picture.shape and np.abs(deep.astype(int) - picture).max() <= 1


@pytest.mark.gl
def test_frames_go_on_while_a_picture_is_written(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held, encoded = threading.Event(), ViewportStill.encoded

    def slow(still: ViewportStill, ending: str, deep: bool, crop: object = None) -> bytes:
        assert held.wait(60.0)
        return encoded(still, ending, deep)

    monkeypatch.setattr(ViewportStill, "encoded", slow)
    window.shell.request(SavePicture(tmp_path / "a.png"))
    window.frames(5)
    # An edit after it was asked for is not in it, and nothing is there by half.
    before = renderer_of(window).source.renderer.linear_image()
    window.shell.editor.do(SetIntensity(0.1))
    window.frames(2)
    assert list(tmp_path.glob("*.png*")) == []
    held.set()
    assert window.run_until(lambda: (tmp_path / "a.png").is_file(), 60.0)
    assert window.run_until(lambda: window.shell.editor.status.message.startswith("saved"), 60.0)
    assert pixels_of(tmp_path / "a.png").max() > 200 and before.max() > 1.0


@pytest.mark.gl
def test_what_cannot_be_written_is_said(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    for path in (tmp_path / "missing" / "a.png", tmp_path):
        window.shell.request(SavePicture(path if path.suffix else path / "a.tiff"))
        window.frames(2)
        assert window.run_until(lambda: editor.status.is_error, 60.0)
        assert str(tmp_path) in editor.status.message
        editor.notify("")
    assert list(tmp_path.iterdir()) == [tmp_path / "state"] or not list(tmp_path.glob("*.*"))


def test_closing_waits_for_what_is_being_written(tmp_path: Path) -> None:
    still = ViewportStill(np.full((600, 600, 3), 0.5, np.float32), np.zeros((600, 600, 3), np.float32))
    saver = StillSaver()
    saver.save(still, tmp_path / "a.png", True)
    saver.close()
    assert (tmp_path / "a.png").is_file()


@pytest.mark.gl
def test_the_format_goes_with_the_names_ending(window: HeadlessWindow, tmp_path: Path) -> None:
    window.shell.actor.files.folders["picture"] = tmp_path
    window.key(imgui.Key.f12)
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.folder, question.name, question.deep) == (tmp_path, "stand-in.png", False)
    for index, expected in ((2, ("stand-in.exr", False)), (1, ("stand-in.png", True)), (0, ("stand-in.png", False))):
        window.click_handle(f"files.picture.{index}")
        question = window.shell.state.question
        assert question is not None and (question.name, question.deep) == expected
    window.click_handle("files.picture.2")
    window.click_handle("button.files.confirm")
    assert window.run_until(lambda: (tmp_path / "stand-in.exr").is_file(), 60.0)
    # The next time it begins with the same, and says that there is one.
    window.key(imgui.Key.f12)
    question = window.shell.state.question
    assert question is not None and question.name == "stand-in.exr"


@pytest.mark.gl
def test_a_picture_with_layers_is_saved_beside_the_work_and_can_be_stopped(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[Path] = []

    def save(saver: LayerSaver, document: Document, view: ViewState, path: Path) -> None:
        begun.append(path)
        monkeypatch.setattr(LayerSaver, "progress", "saving stand-in.exr 34%")

    monkeypatch.setattr(LayerSaver, "save", save)
    monkeypatch.setattr(LayerSaver, "stop", lambda saver: monkeypatch.setattr(LayerSaver, "progress", ""))
    window.shell.actor.files.folders["picture"] = tmp_path
    for _ in range(2):  # the second time the dialog begins with layers
        window.key(imgui.Key.f12)
        window.frames(2)
        if not begun:
            window.click_handle("files.picture.3")
        window.frames(3)
        window.key(imgui.Key.enter)  # the name has the keyboard again
        window.frames(3)
        assert begun[-1] == tmp_path / "stand-in.exr" and not begun[-1].exists()
        window.click_handle("button.saving.stop")
        window.frames(2)
        assert "button.saving.stop" not in window.shell.handles.names()
    assert len(begun) == 2


@pytest.mark.window
def test_f12_saves_the_picture_and_shift_f12_the_window(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    real.do(f"from pathlib import Path; shell.actor.files.folders['picture'] = Path({str(tmp_path)!r})")
    real.key("f12")
    real.text("pot")
    real.key("enter")
    real.wait_until(f"editor.status.message == 'saved {tmp_path / 'pot.png'}'")
    assert pixels_of(tmp_path / "pot.png").shape == (HEIGHT, WIDTH, 3)
    # The keyboard is the window's again: Space is for the picture, not for a control of some panel.
    real.key("space")
    assert real.ask("state.single_panel")
    real.key("space")
    real.do(f"import os; os.chdir({str(tmp_path)!r})")
    real.key("shift+f12")
    real.wait_until("editor.status.message.endswith('.png') and 'insitu-' in editor.status.message")
    (window_picture,) = tmp_path.glob("insitu-*.png")
    assert pixels_of(window_picture).shape == (860, 1380, 3)
