"""One frame of the window: the same code behind a GLFW window and in a framebuffer without a display.

    events ─► panels (draw, return actions) ─► actions carried out ─► picture ─► pixels
    between two frames: the worker's answers, and the picture where the hand is still

The order within a frame puts the hand first: what it did is in the document before the picture is brought up to date,
so a drag and its picture are in the same frame. What only the worker changed is drawn before the frame, in a step of
its own: the hand is heard before and after it, where picture and panels together would hold it up for too long.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Protocol

import moderngl
from imgui_bundle import ImVec2, imgui

from app.editor import Editor
from app.journal import Recovery
from app.library import Entry
from app.status import Status
from ui import layout, theme
from ui.actor import Actor
from ui.brdf_feed import BrdfFeed
from ui.brush import Spot
from ui.gl.interface import InterfaceRenderer
from ui.gl.thumbnails import Thumbnails
from ui.panels import (
    brdf,
    curve_editor,
    dialogs,
    library,
    light,
    material,
    menus,
    objects,
    paint,
    status_bar,
    tradeoff,
    viewport,
)
from ui.panels import (
    help as shortcuts,
)
from ui.panels.actions import Action, CancelDrag
from ui.panels.brdf_board import BrdfBoard
from ui.panels.context import Handles, PanelContext
from ui.panels.picture import Picture
from ui.panels.state import Notice, PanelState
from ui.spoken_names import spoken
from ui.surface_lobe import SurfacePoint
from ui.table_feed import TableFeed

SETTLE_SECONDS = 0.9
HELD_SECONDS = 0.03
# Answers that took longer leave other work to the next look.
LITTLE_SECONDS = 0.002
# Frames that the layout takes to settle after the start.
FIRST_FRAMES = 3
# How often the worker's progress alone is worth a frame: each takes processor time from the worker.
PROGRESS_SECONDS = 0.1


class PictureSource(Protocol):
    """What the shell needs of `ui.picture_feed.PictureFeed`."""

    @property
    def picture(self) -> moderngl.Texture | None: ...

    @property
    def environment(self) -> moderngl.Texture | None: ...

    @property
    def heading(self) -> float: ...

    def map_thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]: ...

    def take(self, editor: Editor, now: float) -> bool: ...

    def draw(self, editor: Editor, last_frame_ms: float) -> bool: ...

    def object_at(self, column: int, row: int) -> str | None: ...

    def surface_at(self, column: int, row: int) -> SurfacePoint | None: ...

    def spot_at(self, column: int, row: int) -> Spot | None: ...


@dataclass(frozen=True)
class FrameResult:
    """`busy`: another frame should follow at once; `redraw_in`: else after this many seconds, None when nothing is due.

    `screenshot`: where the person asked this frame's pixels to be saved; `quit`: whether the window was asked to close.
    """

    busy: bool
    redraw_in: float | None = None
    screenshot: Path | None = None
    quit: bool = False


class Shell:
    """Owns the imgui context, theme, layout and panel state. `source` makes the picture; None until GL is ready."""

    def __init__(
        self,
        context: moderngl.Context,
        editor: Editor,
        *,
        scale: float = 1.0,
        layout_file: Path | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.editor = editor
        self.source: PictureSource | None = None
        self.state = PanelState()
        self.handles = Handles()
        self.actor = Actor(editor)
        self._clock = clock
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        self._io = imgui.get_io()
        self._io.config_flags |= imgui.ConfigFlags_.docking_enable | imgui.ConfigFlags_.nav_enable_keyboard
        self._io.config_docking_always_tab_bar = False
        self._io.config_windows_move_from_title_bar_only = True
        self._io.config_input_text_cursor_blink = False
        self._io.set_ini_filename("")
        self.theme = theme.apply(scale)
        self._layout_file = layout_file
        self._rebuild_layout = not layout.load(layout_file, scale)
        self._gl = context
        self._interface = InterfaceRenderer(context)
        self._brdf_board = BrdfBoard()
        self._tables = TableFeed(context)
        self._brdf = BrdfFeed(context, self._brdf_board, self._picture, self._tables)
        self._frame_ms = 0.0
        self._prepared: bool | None = None
        self._prepared_ms = 0.0
        self._last_frame = clock()
        self._last_input = -math.inf
        self._n_frames = 0
        self._seen_message = ""
        self._told: Status | None = None
        self._told_at = -math.inf
        self.inputs = 0
        self._library_unread = True
        self._thumbnails = Thumbnails(context, self._tables.tables, partial(self._tables.complete, editor))
        self.environments: tuple[str, ...] = ()
        self.scenes: tuple[str, ...] = ()

    @property
    def io(self) -> imgui.IO:
        """Where mouse and keyboard events go in."""
        imgui.set_current_context(self._imgui)
        return self._io

    def note_input(self) -> None:
        """An event came in: tooltips and hover need frames for a little while."""
        self.inputs += 1
        self._last_input = self._clock()

    def note_change(self) -> None:
        """The window itself changed: it needs a frame."""
        self.inputs += 1

    def note_frame_time(self, milliseconds: float) -> None:
        """How long the last frame took until it was on screen, `prepare` not counted.

        The next one is planned by the time of both, and panels show it.
        """
        self._frame_ms = milliseconds + self._prepared_ms
        self._prepared_ms = 0.0

    def offer_recovery(self, recovery: Recovery) -> None:
        """Show a strip over the picture that offers what a journal kept."""
        self.actor.recovery = recovery
        written = datetime.fromtimestamp(recovery.written_at)
        text = f"Edits of {Path(recovery.scene).stem} from {written:%H:%M} on {written:%d %B} were not saved."
        self.state = replace(self.state, journal=text)

    def do(self, *actions: Action) -> None:
        """Carry out actions as if a panel had asked for them (scripts)."""
        self.state = self.actor.perform(actions, self.state, self._clock()).state

    def handle_position(self, name: str) -> tuple[float, float]:
        """Where the handle `name` was drawn, in framebuffer pixels; KeyError lists those there are."""
        return self.handles.position(name)

    def set_scale(self, scale: float) -> None:
        """Follow the screen's scale (1 at 96 dpi); the default layout is built for it."""
        if scale != self.theme.scale:
            imgui.set_current_context(self._imgui)
            self.theme = replace(self.theme, scale=scale)
            theme.set_style(scale)
            self._rebuild_layout = True

    def frame(self, target: moderngl.Framebuffer, size: tuple[int, int], now: float | None = None) -> FrameResult:
        """Take the hand's events, bring the picture up to date and draw the window into `target`, `size` in pixels."""
        now = self._clock() if now is None else now
        imgui.set_current_context(self._imgui)
        self._io.display_size = ImVec2(float(size[0]), float(size[1]))
        self._io.delta_time = min(max(now - self._last_frame, 1e-4), 0.25)
        self._last_frame = now
        self._n_frames += 1
        self._told, self._told_at = _telling(self.editor.status), now
        self._take_message(now)
        self._read_library()
        imgui.new_frame()
        self.handles.begin_frame()
        self._brdf_board.begin_frame()
        actions = self._panels(self._context(now))
        self.handles.end_frame()
        imgui.render()
        outcome = self.actor.perform(actions, replace(self.state, front=None), now)
        self.state = outcome.state
        self._rebuild_layout = outcome.reset_layout
        prepared, self._prepared = self._prepared, None
        hand_first = prepared is None or bool(actions) or self._hand_is_busy
        working = self._draw_picture() if hand_first else bool(prepared)
        working = self._brdf.draw(self.editor, self._surface_at, self._hand_is_busy, now) or working
        target.use()
        target.clear(*theme.BACKDROP)
        self._interface.render(target)
        self._thumbnails_go_on()
        self._remember_layout()
        return self._result(working or bool(actions), outcome.screenshot, outcome.quit)

    def idle(self, now: float) -> bool:
        """Between frames: take the worker's answers. Whether there is something new to draw."""
        return self.take(now) or self._has_news(now)

    def take(self, now: float) -> bool:
        """As `idle`, but without regard to what only the panels would tell."""
        if self.source is None:
            return False
        started = time.perf_counter()
        if self.source.take(self.editor, now):
            return True
        if self._hand_is_busy or time.perf_counter() - started > LITTLE_SECONDS:
            return False
        return self._tables.go_on(self.editor)

    @property
    def awaits_table(self) -> bool:
        """Whether the BRDF panel shows the curves alone of what was measured, until the rest of it is here."""
        return self._brdf_board.curves_alone and not self._brdf_board.why_alone

    def prepare(self) -> None:
        """Before a frame, where the hand is still: bring the picture up to date, and wait until it is."""
        if self.source is None or self._hand_is_busy:
            return
        started = time.perf_counter()
        self._prepared = self.source.draw(self.editor, self._frame_ms)
        self._gl.finish()
        self._prepared_ms = 1e3 * (time.perf_counter() - started)

    def close(self) -> None:
        """Remember the layout and free what was made here."""
        imgui.set_current_context(self._imgui)
        layout.save(self._layout_file, self.theme.scale)
        self._brdf.close()
        self._tables.release()
        self._interface.release()
        self._thumbnails.release()
        imgui.destroy_context(self._imgui)

    @property
    def _hand_is_busy(self) -> bool:
        """Whether a drag is under way, whose frames are to hold its picture."""
        return self.editor.history.dragging or self.state.grip is not None

    def _draw_picture(self) -> bool:
        """Bring the picture up to date; textures that were replaced since the panels drew are drawn in their stead."""
        source = self.source
        if source is None:
            return False
        before = [(t.glo if t is not None else 0, t) for t in (source.picture, source.environment)]
        working = source.draw(self.editor, self._frame_ms)
        for (reference, old), new in zip(before, (source.picture, source.environment), strict=True):
            if old is not None and old is not new:
                self._interface.substitute(reference, new)
        return working

    def _surface_at(self, column: int, row: int) -> SurfacePoint | None:
        """What a pixel sees of the selected object."""
        source, selected = self.source, self.editor.view.selected
        point = None if source is None else source.surface_at(column, row)
        if source is None or point is None or selected is None or source.object_at(column, row) != selected.object:
            return None
        return point

    def _has_news(self, now: float) -> bool:
        """Whether the status differs from what was drawn; by progress alone not sooner than a tenth of a second."""
        telling, told = _telling(self.editor.status), self._told
        if told is None or telling == told:
            return told is None
        only_progress = replace(telling, fraction=told.fraction, text=told.text) == told
        return not only_progress or now - self._told_at >= PROGRESS_SECONDS

    def _result(self, busy: bool, screenshot: Path | None, quit: bool) -> FrameResult:
        since = self._clock() - self._last_input
        held = self.state.grip is not None  # a key held down repeats without an event of its own
        redraw_in = HELD_SECONDS if held else 0.1 if since < SETTLE_SECONDS else None
        settling = since < 0.05 or self._n_frames < FIRST_FRAMES
        follows = self._library_unread or self._thumbnails_follow
        return FrameResult(busy or settling or follows, redraw_in, screenshot, quit)

    def _thumbnail(self, entry: Entry) -> Picture | None:
        return self._picture(self._thumbnails.texture(entry))

    @property
    def _at_leisure(self) -> bool:
        """Whether nobody waits for a frame: neither a hand nor the picture."""
        return not self._hand_is_busy and self.editor.status.picture == "exact"

    @property
    def _thumbnails_follow(self) -> bool:
        """Whether there is one to be made now."""
        return self._at_leisure and self._thumbnails.is_waiting

    def _thumbnails_go_on(self) -> None:
        self._thumbnails.step(may_draw=self._at_leisure)

    def _read_library(self) -> None:
        """A material a frame, once the window has its first ones behind it."""
        if self._library_unread and self._n_frames > FIRST_FRAMES:
            self._library_unread = self.actor.library.read_next()

    def _take_message(self, now: float) -> None:
        """Show what the editor has to say, once."""
        status = self.editor.status
        if status.message != self._seen_message:
            self._seen_message = status.message
            said = spoken(self.editor.document, status.message)
            self.state = replace(self.state, notice=Notice(said, now, status.is_error))

    def _context(self, now: float) -> PanelContext:
        editor, source = self.editor, self.source
        document, status = editor.document, editor.status
        undo, redo = editor.history.undo_label, editor.history.redo_label
        context = PanelContext(
            document=document,
            view=editor.view,
            status=replace(
                status, text=spoken(document, status.text), transport_note=spoken(document, status.transport_note)
            ),
            state=self.state,
            theme=self.theme,
            handles=self.handles,
            brdf=self._brdf_board,
            undo_label=undo and spoken(document, undo),
            redo_label=redo and spoken(document, redo),
            environments=self.environments,
            scenes=self.scenes,
            library=self.actor.library.entries,
            thumbnail=self._thumbnail,
            now=now,
        )
        if source is None:
            return context
        return replace(
            context,
            picture=self._picture(source.picture),
            environment=self._picture(source.environment),
            map_thumbnails=self._map_thumbnails(source),
            map_refusal=self._map_refusal(),
            heading=source.heading,
            object_at=source.object_at,
            spot_at=source.spot_at,
        )

    def _map_thumbnails(self, source: PictureSource) -> dict[str, Picture]:
        """Of the selected layer's images."""
        selected = self.editor.view.selected
        textures = {} if selected is None else source.map_thumbnails(selected.key)
        found = {name: self._picture(texture) for name, texture in textures.items()}
        return {name: picture for name, picture in found.items() if picture is not None}

    def _map_refusal(self) -> str | None:
        editor = self.editor
        selected = editor.view.selected
        return None if selected is None else editor.maps.refusal(selected.key, editor.document.layer(selected.key).maps)

    def _picture(self, texture: moderngl.Texture | None) -> Picture | None:
        if texture is None:
            return None
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        return Picture(self._interface.register(texture), texture.width, texture.height)

    def _panels(self, context: PanelContext) -> list[Action]:
        actions = menus.draw(context)
        actions += status_bar.draw(context)
        layout.begin_dock_space(self.theme.scale, self._rebuild_layout)
        self._rebuild_layout = False
        actions += _window(context, layout.OBJECTS, objects.draw)
        actions += _window(context, layout.LIBRARY, library.draw)
        actions += _window(context, layout.BRDF, brdf.draw)
        actions += _picture_window(context)
        actions += _window(context, layout.CURVE, curve_editor.draw)
        actions += _window(context, layout.MATERIAL, material.draw)
        actions += _window(context, layout.LIGHT, light.draw)
        actions += _window(context, layout.ACCURACY, tradeoff.draw)
        actions += dialogs.draw(context)
        actions += shortcuts.draw(context)
        if self._gesture_cancelled():
            return [CancelDrag()]
        return actions + shortcuts.keyboard(context)

    def _gesture_cancelled(self) -> bool:
        """Whether Esc was pressed in mid-drag: what the panels ask for in this frame belongs to the drag, and goes."""
        return self._hand_is_busy and imgui.is_key_pressed(imgui.Key.escape, False)

    def _remember_layout(self) -> None:
        if self._io.want_save_ini_settings:
            layout.save(self._layout_file, self.theme.scale)
            self._io.want_save_ini_settings = False


def _telling(status: Status) -> Status:
    """What of the status is worth a frame of its own."""
    return replace(status, frame_ms=0.0, memory_mb=0.0, seconds_left=None, fraction=round(status.fraction, 2))


def _window(
    context: PanelContext, panel: layout.Panel, draw: Callable[[PanelContext], list[Action]], flags: int = 0
) -> list[Action]:
    """A dockable window around a panel; closing it is an action like any other."""
    if not context.view.panel_open(panel.key):
        return []
    if context.state.front == panel.key:
        imgui.set_next_window_focus()
    visible, is_open = imgui.begin(panel.window, True, flags | imgui.WindowFlags_.no_collapse)
    actions = draw(context) if visible else []
    imgui.end()
    return actions if is_open else [*actions, layout.closed(panel)]


def _picture_window(context: PanelContext) -> list[Action]:
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    # Docked, it shows what the window was cleared with: painting that again would be a sixth of a software frame.
    flags = (
        imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse | imgui.WindowFlags_.no_background
    )
    actions = _window(context, layout.VIEWPORT, _picture_and_recovery, flags)
    imgui.pop_style_var()
    return actions


def _picture_and_recovery(context: PanelContext) -> list[Action]:
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    actions = viewport.draw(context)
    actions += paint.draw_strip(context, corner, room)
    return actions + viewport.draw_recovery(context, corner, room)
