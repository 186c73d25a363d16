"""The whole window, compared panel by panel with the picture that stands in tests/golden.

A small scene of its own, with real transport, at the default layout and size. Before the comparison both pictures are
averaged over blocks of 4 × 4 pixels, because glyphs and lines may land differently between versions of Mesa and imgui:
within a block their ink is the same. What may then differ, in steps of 255, in a panel:

- 2 on average (rms): text drawn a fraction of a pixel aside gives 0.5 to 1; a panel that is missing gives 12 or more;
- 5 % of the blocks by more than 12: numbers that are measured, and edges, move this much; a missing control, another
  number in a field, or a picture with another light move more.

Made on Mesa's llvmpipe; another rasterizer is not held to it. To accept a new look, and then look at it:
INSITU_ACCEPT_GOLDEN=1 python -m pytest tests/ui/test_golden_window.py
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from app.document.commands.light import SetRotation
from app.document.view_state import OpenPanel, SetView
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.ui.small_scene import opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.shell import Shell

pytestmark = pytest.mark.gl

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "window.png"
BLOCK = 4
LARGEST_RMS = 2.0
FAR_OFF, LARGEST_SHARE = 12.0, 0.05
# Where each panel of the default layout is at 1280 x 800: left, top, right, bottom.
PANELS = {
    "menu": (0, 0, 1280, 32),
    "objects": (0, 36, 216, 356),
    "library": (0, 360, 216, 768),
    "viewport": (220, 36, 984, 528),
    "curve": (220, 536, 984, 768),
    "material": (992, 36, 1280, 268),
    "light": (992, 276, 1280, 492),
    "accuracy": (992, 500, 1280, 768),
    "status": (0, 772, 1280, 800),
}


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessWindow]:
    """The window with an edited curve, its picture exact; what is measured by the clock stands still."""
    if "llvmpipe" not in context.info["GL_RENDERER"]:
        pytest.skip("the golden picture is that of Mesa's llvmpipe")
    monkeypatch.setattr("app.messages.editor_status.resident_megabytes", lambda *pids: 512.0)
    monkeypatch.setattr(Shell, "note_frame_time", lambda shell, milliseconds: setattr(shell, "_frame_ms", 12.5))
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, write_small_scene(tmp_path), client, n_lights=400) as opened:
        editor = opened.shell.editor
        editor.do(SetView.of(regions=(0.1, 0.3, 0.6, 0.9)))
        editor.select("ball.1.theta_h")
        wait_until_exact(opened)
        opened.drag_handle("curve.magnitude", (0, -30))
        wait_until_exact(opened)
        assert opened.run_until(lambda: editor.status.estimate is not None, 600.0), editor.status
        editor.notify("")
        opened.move(400.0, 15.0)
        opened.frames(60)  # until the library has been read, a file a frame
        yield opened


def blocks(pixels: np.ndarray) -> np.ndarray:
    """Means over blocks: (H/4, W/4, 3)."""
    height, width = (size // BLOCK for size in pixels.shape[:2])
    return pixels.astype(float).reshape(height, BLOCK, width, BLOCK, 3).mean(axis=(1, 3))


def panels_that_differ(found: np.ndarray, expected: np.ndarray) -> dict[str, str]:
    """The panels beyond the tolerance, with the figures that say so."""
    differ = {}
    for name, box in PANELS.items():
        left, top, right, bottom = (edge // BLOCK for edge in box)
        difference = np.abs(blocks(found) - blocks(expected))[top:bottom, left:right]
        rms = float(np.sqrt(np.mean(difference**2)))
        share = float(np.mean(difference.max(axis=-1) > FAR_OFF))
        if rms > LARGEST_RMS or share > LARGEST_SHARE:
            differ[name] = f"rms {rms:.2f}, {100.0 * share:.1f} % of the blocks differ by more than {FAR_OFF:.0f}"
    return differ


def test_the_window_looks_as_it_did(window: HeadlessWindow, tmp_path: Path) -> None:
    found = window.pixels()
    if os.environ.get("INSITU_ACCEPT_GOLDEN"):
        Image.fromarray(found).save(GOLDEN, optimize=True)
    expected = np.asarray(Image.open(GOLDEN).convert("RGB"))
    assert found.shape == expected.shape
    differ = panels_that_differ(found, expected)
    if differ:
        Image.fromarray(found).save(tmp_path / "window.png")
        distance = np.abs(found.astype(int) - expected.astype(int)).astype(np.uint8)
        Image.fromarray(distance).save(tmp_path / "difference.png")
    assert not differ, f"see {tmp_path}"


def _without(panel: str) -> Callable[[HeadlessWindow], None]:
    return lambda window: window.shell.editor.do(OpenPanel(panel, False))  # type: ignore[return-value]


def _doing(command: object) -> Callable[[HeadlessWindow], None]:
    return lambda window: window.shell.editor.do(command)  # type: ignore[arg-type, return-value]


CHANGES: dict[str, tuple[Callable[[HeadlessWindow], None], set[str]]] = {
    "no objects": (_without("objects"), {"objects"}),
    "no curve": (_without("curve"), {"curve"}),
    "no material": (_without("material"), {"material"}),
    "no accuracy": (_without("accuracy"), {"accuracy"}),
    "a third of a stop brighter": (_doing(SetView.of(exposure=1 / 3)), {"viewport"}),
    "light from elsewhere": (_doing(SetRotation(90.0)), {"viewport", "light"}),
    "the edit undone": (lambda window: window.key(imgui.Key.z, imgui.Key.mod_ctrl), {"curve"}),
    "another layer": (lambda window: window.shell.editor.select("ground.0") and None, {"curve", "material"}),
}


@pytest.mark.sweep
def test_what_is_missing_or_wrong_is_found(window: HeadlessWindow) -> None:
    # Each change is made to the same window and taken back; what it is called on the right must be found.
    editor = window.shell.editor
    start, view = window.pixels(), editor.view
    for name, (change, expected) in CHANGES.items():
        document = editor.document
        change(window)
        wait_until_exact(window)
        differ = panels_that_differ(window.pixels(), start)
        assert expected <= set(differ), f"{name}: {differ}"
        if editor.document != document:
            editor.redo() if name == "the edit undone" else editor.undo()
        editor.select(view.selected)
        editor.view = view
        editor.notify("")
    wait_until_exact(window)
    assert not panels_that_differ(window.pixels(), start)
