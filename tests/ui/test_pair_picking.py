"""The picking of pairs for a match: whatever ends it, what was shown before comes back; and the photograph is known by
its file."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from app.document.commands.light import SetIntensity
from app.document.view_state import Difference, SetView
from app.operators.registry import run_operator
from app.photo.match_settings import PhotoPair
from app.photo.photo_controller import PhotoController
from engine.core.safe_files import resolved
from tests.app.photo.test_photo_controller import Matcher
from tests.pictures import write_flawed_exr
from tests.ui.stand_in import HEIGHT, WIDTH
from tests.ui.test_photo_panel import settings
from ui.headless import HeadlessWindow
from ui.panels import pair_picking
from ui.panels.actions import AnswerQuestion, OpenPhoto, SetPanel

pytestmark = pytest.mark.gl
LIGHT = np.ones((HEIGHT, WIDTH, 4), np.float32)
PAIRS = tuple(PhotoPair((0.1 * i, 0.05 * i * i), (0.1 * i, 0.2, 0.3)) for i in range(4))
Exit = Callable[[HeadlessWindow], object]


@pytest.fixture
def photo(window: HeadlessWindow, tmp_path: Path) -> Path:
    """Of the open panel, read already; a picture of its name from another folder is stored as well."""
    window.shell.actor.photos = PhotoController(window.shell.editor, Matcher())
    (tmp_path / "other").mkdir()
    file, editor = resolved(tmp_path / "pot.png"), window.shell.editor
    for each in (file, resolved(tmp_path / "other" / "pot.png")):
        each.write_bytes(b"not read by the window")
    for each in (resolved(tmp_path / "other" / "pot.png"), file):
        editor.stored.store_file(LIGHT, each)
    editor.stored.store(LIGHT, "Night")
    editor.select("teapot.1.theta_h")
    open_photo(window, file)
    return file


def open_photo(window: HeadlessWindow, file: Path) -> None:
    window.shell.do(AnswerQuestion(file, OpenPhoto(file)))
    window.frames(3)


def shown(window: HeadlessWindow) -> tuple[str, str, object]:
    view = window.shell.editor.view
    return view.stored, view.difference, view.compare


def show(window: HeadlessWindow, stored: str, difference: Difference) -> tuple[str, str, object]:
    """Compare with a stored picture, or with the document as it is, "A/B"."""
    if stored == "A/B":
        window.shell.editor.do(SetView.of(compare=window.shell.editor.document, stored="", difference=difference))
    else:
        window.shell.editor.do(SetView.of(compare=None, stored=stored, difference=difference))
    return shown(window)


def begin(window: HeadlessWindow, is_half: bool = False) -> None:
    """Begin to pick pairs; is_half: a point of the picture is chosen."""
    window.click_handle("match.camera.1")
    window.frames(3)
    assert window.shell.state.picking is not None and shown(window) == ("pot.png 2", "present", None)
    if is_half:
        choose_point(window)
        assert shown(window) == ("pot.png 2", "stored", None)


def choose_point(window: HeadlessWindow) -> None:
    assert window.shell.state.picking is not None
    window.shell.do(*pair_picking.go_on(window.shell.state.picking, (0.0, 0.1, 0.2)))


def set_panel(**changes: object) -> Exit:
    return lambda window: window.shell.do(SetPanel(changes))


def escape(window: HeadlessWindow) -> None:
    picking = window.shell.state.picking
    assert picking is not None
    if picking.point is not None:
        window.key(imgui.Key.escape)
        assert window.shell.state.picking is not None and shown(window) == ("pot.png 2", "present", None)
    window.key(imgui.Key.escape)


def match(window: HeadlessWindow) -> None:
    window.shell.do(SetPanel({"match": replace(settings(window), pairs=PAIRS)}))
    window.frames(4)
    window.click_handle("button.match.begin")
    window.frames(2)
    assert window.shell.actor.photos.progress
    window.shell.actor.photos.stop()


def choose_other_photo(window: HeadlessWindow) -> None:
    file = settings(window).file
    open_photo(window, file.parent / "other" / "pot.png")
    assert window.shell.state.picking is None
    open_photo(window, file)


def choose_mode(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetView.of(mode="orbit"))
    window.frames(2)
    window.shell.editor.do(SetView.of(mode="placement"))


EXITS: dict[str, Exit] = {
    "Esc": escape,
    "the scene's camera": lambda window: window.click_handle("match.camera.0"),
    "the panel closed": set_panel(match=None),
    "a match": match,
    "another photograph": choose_other_photo,
    "another scene": lambda window: set_panel(match=replace(settings(window), scene="another"))(window),
    "another mode": choose_mode,
}
TOOLS: dict[str, Exit] = {tool: set_panel(**{tool: True}) for tool in pair_picking.TOOLS}
# Those by which the user chooses himself what is compared.
CHOICES: dict[str, tuple[Exit, str]] = {
    "removed": (lambda window: run_operator(window.shell.editor, "remove_stored", "pot.png 2"), ""),
    "replaced": (lambda window: window.shell.editor.stored.store(LIGHT, "pot.png 2"), "pot.png 2"),
    "another": (lambda window: run_operator(window.shell.editor, "compare_with", "pot.png"), "pot.png"),
    "none": (lambda window: window.click_handle("button.stored.close"), ""),
    "A/B": (lambda window: run_operator(window.shell.editor, "compare"), ""),
}


def tidy_up(window: HeadlessWindow, photo: Path) -> None:
    """The panel open without pairs, no tool, the photograph stored."""
    window.shell.do(SetPanel(dict.fromkeys(pair_picking.TOOLS, False)))
    stored = window.shell.editor.stored
    if "pot.png 2" in stored.names and stored.names_of(photo) != ("pot.png 2",):
        stored.remove("pot.png 2")
    stored.store_file(LIGHT, photo)
    window.frames(2)
    if window.shell.state.match is None or settings(window).pairs:
        open_photo(window, photo)


@pytest.mark.parametrize("name", EXITS)
def test_however_it_ends_what_was_shown_comes_back(window: HeadlessWindow, photo: Path, name: str) -> None:
    check_exit(window, photo, EXITS[name], False, "", "split")
    check_exit(window, photo, EXITS[name], True, "Night", "signed")
    check_exit(window, photo, EXITS[name], True, "A/B", "stored")


def test_another_tool_ends_it(window: HeadlessWindow, photo: Path) -> None:
    for leave in TOOLS.values():
        check_exit(window, photo, leave, True, "Night", "signed")


def check_exit(
    window: HeadlessWindow, photo: Path, leave: Exit, is_half: bool, stored: str, difference: Difference
) -> None:
    before = show(window, stored, difference)
    begin(window, is_half)
    leave(window)
    window.frames(3)
    assert window.shell.state.picking is None and shown(window) == before
    tidy_up(window, photo)


@pytest.mark.parametrize("name", CHOICES)
def test_another_comparison_ends_it_and_stays(window: HeadlessWindow, photo: Path, name: str) -> None:
    choose, stored = CHOICES[name]
    show(window, "Night", "absolute")
    begin(window)
    choose(window)
    window.frames(3)
    compared = window.shell.editor.document if name == "A/B" else None
    assert window.shell.state.picking is None and shown(window) == (stored, "absolute", compared)


def test_the_panel_is_closed_by_esc_last(window: HeadlessWindow, photo: Path) -> None:
    begin(window, is_half=True)
    found = []
    for _ in range(3):
        window.key(imgui.Key.escape)
        window.frames(2)
        state = window.shell.state
        found.append((state.picking is not None, state.match is not None))
    assert found == [(True, True), (False, True), (False, False)]


def test_a_photograph_that_cannot_be_read_ends_it(window: HeadlessWindow, photo: Path) -> None:
    before = show(window, "Night", "signed")
    for name in ("gone.png", "broken.png"):
        file = photo.with_name(name)
        file.write_bytes(b"no picture")
        open_photo(window, file)
        if name == "gone.png":
            file.unlink()
        window.click_handle("match.camera.1")
        window.frames(1)
        assert window.run_until(lambda: window.shell.state.picking is None, 20.0)
        assert window.shell.editor.status.is_error and name in window.shell.editor.status.message
        assert shown(window) == before


def test_what_is_read_after_it_has_ended_is_not_compared(window: HeadlessWindow, photo: Path) -> None:
    editor, before = window.shell.editor, show(window, "Night", "signed")
    editor.stored.remove("pot.png 2")
    window.click_handle("match.camera.1")
    window.shell.do(SetPanel({"match": None}))
    window.frames(2)
    assert window.run_until(lambda: not editor.stored.is_reading, 20.0)
    window.frames(2)
    assert shown(window) == before


def test_marks_are_where_they_are_in_what_is_shown(window: HeadlessWindow, photo: Path) -> None:
    """At the points in the picture; at their places in the photograph, which no picture of its name is."""
    editor = window.shell.editor
    begin(window)
    pair = PhotoPair((0.9, 0.9), editor.camera_history.camera.target)
    window.shell.do(SetPanel({"match": replace(settings(window), pairs=(pair,))}))

    def mark() -> np.ndarray:
        window.frames(2)
        assert window.run_until(lambda: not window.shell.awaits_difference, 20.0)
        window.frames(2)
        return np.array(window.shell.handle_position("viewport.pair.1"))

    corner, centre = (np.array(window.shell.handle_position(f"viewport.{name}")) for name in ("corner", "centre"))
    np.testing.assert_allclose(mark(), centre, atol=2.0)
    editor.do(SetView.of(difference="stored"))
    np.testing.assert_allclose(mark(), corner + 1.8 * (centre - corner), atol=2.0)


def test_a_photograph_of_another_shape_is_shown_in_its_own(window: HeadlessWindow, tmp_path: Path, photo: Path) -> None:
    """Half as wide as the picture, in its middle; a click beside it is no place in it."""
    tall, editor = resolved(tmp_path / "tall.png"), window.shell.editor
    tall.write_bytes(b"not read by the window")
    editor.stored.store_file(0.5 * LIGHT[:, : WIDTH // 2], tall)
    open_photo(window, tall)
    window.click_handle("match.camera.1")
    window.frames(3)
    choose_point(window)
    assert window.run_until(lambda: not window.shell.awaits_difference, 20.0)
    window.frames(4)
    corner, centre = (np.array(window.shell.handle_position(f"viewport.{name}")) for name in ("corner", "centre"))
    size = 2.0 * (centre - corner)
    screen = window.pixels()
    # At the left the panel is over it.
    inside, beside = (screen[int(centre[1]), int(corner[0] + share * size[0])].astype(int) for share in (0.7, 0.8))
    assert inside[:3].min() > 150 and beside[:3].max() < 60
    window.click(*(corner + (0.8, 0.5) * size))
    window.frames(2)
    # No place in it, and no object of the picture is under the mouse.
    assert not settings(window).pairs and editor.view.hovered is None
    window.click(*(corner + (0.625, 0.5) * size))
    window.frames(3)
    (pair,) = settings(window).pairs
    assert pair.place == pytest.approx((0.75, 0.5), abs=0.02)
    choose_point(window)
    window.frames(4)
    mark = np.array(window.shell.handle_position("viewport.pair.1"))
    np.testing.assert_allclose(mark, corner + (0.625, 0.5) * size, atol=2.0)


@pytest.mark.parametrize("name", ["pot.jpg", "pot.webp", "pot.exr"])
def test_pairs_are_picked_on_files_of_any_format(window: HeadlessWindow, tmp_path: Path, name: str) -> None:
    """Also where a pixel is not finite, which no error can be measured of."""
    file, editor = resolved(tmp_path / name), window.shell.editor
    window.shell.actor.photos = PhotoController(editor, Matcher())
    editor.select("teapot.1.theta_h")
    if file.suffix == ".exr":
        light = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
        light[3, 2] = np.nan
        write_flawed_exr(file, light)
        editor.stored.load(file)
        assert window.run_until(lambda: not editor.stored.is_reading, 20.0)
        assert "pot.exr: pixel 2, 3" in editor.status.message and not editor.stored.names
    else:
        Image.new("RGB", (WIDTH, HEIGHT), (188, 188, 188)).save(file)
    open_photo(window, file)
    window.click_handle("match.camera.1")
    window.frames(1)
    assert window.run_until(lambda: bool(editor.stored.names), 20.0)
    window.frames(3)
    (stored,) = editor.stored.names
    read = editor.stored.picture(stored).light
    assert editor.view.stored == stored == name and read[20, 20, 0] == pytest.approx(0.5, abs=0.02)
    assert np.isfinite(read).all() and (read[3, 2, 0] == 0.0) == (file.suffix == ".exr")
    choose_point(window)
    window.frames(3)
    corner, centre = (np.array(window.shell.handle_position(f"viewport.{place}")) for place in ("corner", "centre"))
    window.click(*(corner + (1.6, 1.0) * (centre - corner)))
    window.frames(3)
    (pair,) = settings(window).pairs
    assert pair.place == pytest.approx((0.8, 0.5), abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_any_sequence(seed: int, window: HeadlessWindow, photo: Path) -> None:
    """While pairs are picked the photograph is shown as long as its half of a pair is asked for; after it, what was
    shown before."""
    rng, before = random.Random(seed), shown(window)
    exits = EXITS | TOOLS
    names = ("begin", "begin", "half", "half", "edit", "show", *exits, *CHOICES)
    for _ in range(40):
        is_picking, name = window.shell.state.picking is not None, rng.choice(names)
        if name == "begin" and not is_picking:
            before = shown(window)
            begin(window, rng.random() < 0.5)
        elif name == "half" and is_picking:
            choose_point(window)
        elif name == "edit":
            window.shell.editor.do(SetIntensity(rng.uniform(0.5, 2.0)))
        elif name == "show" and not is_picking:
            before = show(
                window, rng.choice(("", "Night", "A/B", "pot.png 2")), rng.choice(("split", "signed", "present"))
            )
        elif name in exits and is_picking:
            exits[name](window)
            window.frames(3)
            assert shown(window) == before, name
        elif name in CHOICES and is_picking:
            CHOICES[name][0](window)
            window.frames(3)
            assert window.shell.state.picking is None and shown(window)[:2] == (CHOICES[name][1], before[1]), name
            before = shown(window)
        window.frames(2)
        picking = window.shell.state.picking
        if picking is None:
            assert shown(window) == before
            tidy_up(window, photo)
            before = show(window, before[0] if before[2] is None else "A/B", before[1])  # type: ignore[arg-type]
        else:
            assert shown(window) == ("pot.png 2", "present" if picking.point is None else "stored", None)
