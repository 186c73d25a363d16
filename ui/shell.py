"""One frame of the window: the same code behind a GLFW window and in a framebuffer without a display.

    events ─► panels (draw, return actions) ─► actions carried out ─┬─► picture ─► pixels
       ▲───────────────── while there are more events ◄─────────────┘
    between two frames: the worker's responses, and the picture where there is no input

The order within a frame puts input first: it changes the document before the picture is updated, so a drag and its
picture are in the same frame. Events that came during a long frame are all processed in the next one, in order, in as
many passes through the panels as that takes (`ui.event_queue`). What only the worker changed is drawn before the frame,
in a step of its own: input is processed before and after it, where picture and panels together would delay it too long.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import moderngl
from imgui_bundle import ImVec2, imgui

from app.document.display_names import with_display_names
from app.editor.editor import Editor
from app.files.preferences import PreferenceFile, RecentFiles
from ui import theme
from ui.action_handler import ActionHandler, FrameOutcome
from ui.brdf_feed import BrdfFeed, TableFeed
from ui.event_queue import ALTS, EventQueue
from ui.frame_times import REDRAW_SECONDS, FramePacing, FrameResult, PerformanceRecord
from ui.gl.interface import InterfaceRenderer
from ui.highlight_feed import HighlightFeed
from ui.layout import Docking
from ui.look_feed import LookFeed
from ui.panel_pictures import PanelPictures, panel_context
from ui.panels import file_dialog, grab, shortcuts
from ui.panels.actions import Action, CancelDrag, SetPanel
from ui.panels.context import Fields, Handles, PanelContext
from ui.panels.look_board import LookBoard
from ui.panels.panel_windows import close_what_is_open, depth_now, draw_guarded, draw_panels
from ui.panels.pictures import BrdfBoard
from ui.panels.window_state import PanelState, StatusMessage
from ui.picture_feed import PictureFeed
from ui.picture_saving import PictureSaving
from ui.surface_lobe import SurfacePoint

TITLE = "Insitu"
# Responses that took longer leave other work to the next poll.
SHORT_FRAME_SECONDS = 0.002
# How long a frame that failed waits for the next, where no event comes.
FAILED_SECONDS = 1.0
# A frame processes no further events after this time, a fraction of a long frame; the next, at once, does the rest.
EVENT_SECONDS = 0.03
# imgui's own 0.3 is less than desktops have, and passes in two frames.
DOUBLE_CLICK_SECONDS = 0.45
# imgui requires its clock to advance between two passes; it stands still while earlier events are being processed.
NO_TIME = 1e-4
# Tells imgui that Alt is not its own to use: it would move to the tabs of panels.
SHORTCUT_OWNER = 0x1A5171


class Shell:
    """Owns the imgui context, theme, layout and panel state. `source` makes the picture; None until GL is ready."""

    def __init__(
        self,
        context: moderngl.Context,
        editor: Editor,
        *,
        scale: float = 1.0,
        layout_file: Path | None = None,
        recent: RecentFiles | None = None,
        preferences: PreferenceFile | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.editor = editor
        self.source: PictureFeed | None = None
        self.state = PanelState()
        self.handles = Handles()
        self._fields = Fields()
        self.actor = ActionHandler(editor, recent=recent, preferences=preferences)
        self._clock = clock
        self.pacing = FramePacing(clock)
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        self._io = imgui.get_io()
        self._io.config_flags |= imgui.ConfigFlags_.docking_enable | imgui.ConfigFlags_.nav_enable_keyboard
        self._io.config_docking_always_tab_bar = False
        self._io.config_windows_move_from_title_bar_only = True
        self._io.config_input_text_cursor_blink = False
        self._io.mouse_double_click_time = DOUBLE_CLICK_SECONDS
        self._io.set_ini_filename("")
        self.events = EventQueue(self._imgui, self._io)
        self._is_behind = False
        self.theme = theme.apply(scale)
        self._docking = Docking(editor, layout_file, scale)
        self._front: tuple[str, ...] = ()
        self._gl = context
        self._interface = InterfaceRenderer(context)
        self._brdf_board = BrdfBoard()
        self._tables = TableFeed(context)
        self._pictures = PanelPictures(context, editor, self._interface, self._tables)
        self._brdf = BrdfFeed(context, self._brdf_board, self._pictures.picture, self._tables)
        self._look_board = LookBoard()
        self.looks = LookFeed(context, self._look_board, self._pictures.picture)
        self._escape_is_imguis = False
        self._focus_comes_in = 0
        self._frame_ms = 0.0
        self._record = PerformanceRecord()
        self._prepared: bool | None = None
        self._prepared_ms = 0.0
        self._last_frame = clock()
        self._shown_message = 0
        self._requested: list[Action] = []
        self.saving = PictureSaving(context, editor)
        self.highlights = HighlightFeed(context, editor)
        self._shown_work = ("", "")
        self._library_unread = True
        self.environments: tuple[str, ...] = ()
        self.scenes: tuple[str, ...] = ()

    @property
    def io(self) -> imgui.IO:
        """imgui's state of mouse and keyboard; events go into `events`."""
        imgui.set_current_context(self._imgui)
        return self._io

    def note_frame_time(self, milliseconds: float) -> None:
        """Note how long the last frame took until it was on screen, without `prepare`.

        The next one is planned by the time of both, and panels show it.
        """
        self._frame_ms = milliseconds + self._prepared_ms
        self._prepared_ms = 0.0

    def request(self, *actions: Action) -> None:
        """Carry out actions in the coming frame, as if a panel returned them then."""
        self._requested += actions
        self.pacing.note_input()

    def drop(self, paths: Sequence[str], image: str | None = None) -> None:
        """Files were dropped on the window; `image`: on the "texture" or the "weight" of the selected layer. With Shift
        held meshes are added to the scene."""
        question = self.state.question
        if question is not None and len(paths) == 1:
            self.do(*file_dialog.dropped(question, Path(paths[0])))
        else:
            self.do(*self.actor.files.open_dropped(paths, image, imgui.get_io().key_shift))

    @property
    def title(self) -> str:
        """The window's title: what is open, and a star where it has unsaved edits."""
        name = self.editor.session.name
        return f"{name}{'*' if self.editor.session.is_unsaved else ''} - {TITLE}" if name else TITLE

    def do(self, *actions: Action) -> None:
        """Carry out actions at once as if a panel had returned them (scripts)."""
        self.state = self.actor.perform(actions, self.state, self._clock()).state

    def handle_position(self, name: str) -> tuple[float, float]:
        """The position where the handle `name` was drawn, in framebuffer pixels; KeyError lists those there are."""
        return self.handles.position(name)

    def set_scale(self, scale: float) -> None:
        """Adopt the screen's scale (1 at 96 dpi); the default layout is built for it."""
        if scale != self.theme.scale:
            imgui.set_current_context(self._imgui)
            self.theme = replace(self.theme, scale=scale)
            theme.set_style(scale)
            self._docking.rescale(scale)

    def frame(self, target: moderngl.Framebuffer, size: tuple[int, int], now: float | None = None) -> FrameResult:
        """Process events, update the picture and draw the window into `target`, `size` in pixels."""
        now = self._clock() if now is None else now
        failed = FrameResult(busy=False, redraw_in=FAILED_SECONDS, drawn=False)
        return self.editor.barrier.run("The window", partial(self._frame, target, size, now), failed, ())

    def _frame(self, target: moderngl.Framebuffer, size: tuple[int, int], now: float) -> FrameResult:
        try:
            return self._whole_frame(target, size, now)
        except BaseException:
            self._end_what_was_begun()
            raise

    def _end_what_was_begun(self) -> None:
        """End imgui's frame, where one has begun: leave imgui as it is between two frames."""
        imgui.set_current_context(self._imgui)
        if imgui.get_current_context().within_frame_scope:
            close_what_is_open(self._depth)
            imgui.end_frame()

    def _whole_frame(self, target: moderngl.Framebuffer, size: tuple[int, int], now: float) -> FrameResult:
        imgui.set_current_context(self._imgui)
        self._io.display_size = ImVec2(float(size[0]), float(size[1]))
        self._io.delta_time = NO_TIME if self._is_behind else min(max(now - self._last_frame, NO_TIME), 0.25)
        self._last_frame = now
        status = self.editor.status
        self.pacing.begin_frame(now, status)
        self._record.add_frame(now, self._frame_ms, status.image_error)
        self._take_message(now)
        self.editor.barrier.run("The library", self._read_library, None, ())
        self._docking.take_size(size, self.theme.scale)
        # Before the panels draw their textures, some of which it replaces.
        follow = partial(self.looks.follow, self.editor, now)
        follows = self.editor.barrier.run("Looks side by side", follow, False, ())
        compare = partial(self._pictures.difference.follow, self.editor, self.source)
        follows |= self.editor.barrier.run("The difference", compare, False, ())
        actions, outcome = self._process_events(now)
        imgui.render()
        self._note_look()
        prepared, self._prepared = self._prepared, None
        hand_first = prepared is None or bool(actions) or self._is_dragging
        working = self._draw_picture() if hand_first else bool(prepared)
        working = self._draw_brdf(now) or working
        paint = partial(self.highlights.step, outcome.highlight, self.source, self.state)
        self.state = self.editor.barrier.run("The highlight", paint, self.state, ())
        working = working or follows or self._pictures.difference.is_behind(self.editor, self.source)
        if outcome.picture is not None:
            self.saving.save(outcome.picture, self.source)
        working |= self.editor.barrier.run("The stored picture", self.saving.follow, False, ())
        if outcome.stops_layers:
            self.saving.stop()
        if outcome.draws_looks is not None:
            (self.looks.pictures.resume if outcome.draws_looks else self.looks.pictures.stop)()
        self.draw_interface(target)
        thumbnail = partial(self._pictures.materials.step, may_draw=self._is_idle)
        self.editor.barrier.run("A thumbnail", thumbnail, None, ())
        self.editor.barrier.run("A view's picture", self._follow_view, None, ())
        self._docking.remember()
        return self._result(working or bool(actions) or self._docking.is_settling, outcome.screenshot, outcome.quit)

    def draw_interface(self, target: moderngl.Framebuffer) -> None:
        """Draw the interface of this frame's panels, or of the last, into `target`."""
        imgui.set_current_context(self._imgui)
        target.use()
        target.clear(*theme.BACKDROP)
        self._interface.render(target)

    def _process_events(self, now: float) -> tuple[list[Action], FrameOutcome]:
        """Pass through the panels until all events that have come are processed, and carry out the panels' actions."""
        end = time.perf_counter() + EVENT_SECONDS
        actions, outcome = self._pass(now)
        while not (self.events.is_empty or outcome.quit or time.perf_counter() > end):
            imgui.end_frame()
            self._io.delta_time = NO_TIME
            requested, later = self._pass(now)
            actions, outcome = actions + requested, later.after(outcome)
        self._is_behind = not self.events.is_empty  # a double click stays one, however long that takes
        return actions, outcome

    def _pass(self, now: float) -> tuple[list[Action], FrameOutcome]:
        """Pass the next events to the panels."""
        keys_taken, self._escape_is_imguis = shortcuts.keys_are_taken(), shortcuts.imgui_takes_escape()
        # imgui gives a field the keyboard in the pass after that in which the dialog asks for it.
        self.events.dispatch(shortcuts.is_typing(), waits=self._focus_comes_in > 0)
        self._focus_comes_in = max(self._focus_comes_in - 1, 0)
        self._docking.make_room(self.state.front)
        if not keys_taken:  # else imgui would also move to a control of the panel that was last in use
            for key in (imgui.Key.home, imgui.Key.end):
                imgui.internal.set_key_owner(key, SHORTCUT_OWNER)
        imgui.new_frame()
        self._depth = depth_now()
        for key in ALTS:
            imgui.internal.set_key_owner(key, SHORTCUT_OWNER)
        grab.claim_input(self.state)
        self.handles.begin_frame()
        self._brdf_board.begin_frame()
        self._look_board.begin_frame()
        events = self.events
        context = replace(
            self._context(now), keys_taken=keys_taken, alt_tapped=events.alt_tapped, repeated=events.repeated
        )
        requested, self._requested = self._requested, []
        actions = [*requested, *self._panels(context), *self._refusal(now)]
        self.handles.end_frame()
        outcome = self.actor.perform(actions, replace(self.state, front=self._front), now)
        if outcome.state.question != self.state.question and outcome.state.question and outcome.state.question.focus:
            self._focus_comes_in = 2
        self.state = outcome.state
        if outcome.reset_layout:
            self._docking.reset()
        return actions, outcome

    def _refusal(self, now: float) -> list[Action]:
        """The message that says why a typed number was refused."""
        refusal, self._fields.refusal = self._fields.refusal, ""
        return [SetPanel({"message": StatusMessage(refusal, now, True)})] if refusal else []

    def idle(self, now: float) -> bool:
        """Between frames: process the worker's responses. Returns whether there is something new to draw."""
        return self.take(now) or self.editor.barrier.run("The status", partial(self._has_news, now), False, ())

    def take(self, now: float) -> bool:
        """As `idle`, but without regard to what only the panels would show."""
        self.saving.notify_finished()
        source, run = self.source, self.editor.barrier.run
        if run("The match", self.actor.photos.follow, False, ()):
            return True
        if source is None:
            return False
        if run("Looks side by side", lambda: self.looks.has_news, False, ()):
            return True
        started = time.perf_counter()
        if run("The worker's answers", lambda: source.take(self.editor, now), False, ()):
            return True
        if self.highlights.is_due(source):
            return True
        if self._is_dragging or time.perf_counter() - started > SHORT_FRAME_SECONDS:
            return False
        return run("A measured table", lambda: self._tables.advance(self.editor), False, ())

    @property
    def awaits_table(self) -> bool:
        """Whether the BRDF panel shows only the curves of a measurement, until the rest of it is here."""
        return self._brdf_board.curves_alone and not self._brdf_board.why_alone

    @property
    def awaits_difference(self) -> bool:
        """Whether the comparison with a stored picture is not yet that of the present one."""
        is_behind = self._pictures.difference.is_behind(self.editor, self.source)
        return is_behind or self.saving.is_storing or self.editor.stored.is_reading

    def prepare(self) -> None:
        """Before a frame without input: update the picture, and wait until it is drawn."""
        if self.source is None or self._is_dragging:
            return
        started = time.perf_counter()
        self._prepared = self._draw_source(self.source)
        self._gl.finish()
        self._prepared_ms = 1e3 * (time.perf_counter() - started)

    def close(self) -> None:
        """Store the layout and free what was made here."""
        imgui.set_current_context(self._imgui)
        self.saving.close()
        self.actor.photos.close()
        self._docking.keep()
        self._brdf.close()
        self.looks.close()
        self._tables.release()
        self._interface.release()
        self._pictures.release()
        self.highlights.release()
        imgui.destroy_context(self._imgui)

    @property
    def _is_dragging(self) -> bool:
        """Whether a drag is under way, whose frames must include its picture."""
        return self.editor.history.dragging or self.state.grip is not None

    def _note_look(self) -> None:
        """Before the picture follows the document: what was on screen of a look that was left stays beside it."""
        picture = None if self.source is None else self.source.picture
        note = partial(self.looks.note_switch, self.editor, picture)
        self.editor.barrier.run("Looks", note, None, ())

    def _draw_picture(self) -> bool:
        """Update the picture; textures that were replaced since the panels drew are drawn in their place."""
        source = self.source
        if source is None:
            return False
        before = [(t.glo if t is not None else 0, t) for t in (source.picture, source.environment)]
        working = self._draw_source(source)
        for (reference, old), new in zip(before, (source.picture, source.environment), strict=True):
            if old is not None and old is not new:
                self._interface.substitute(reference, new)
        return working

    def _draw_source(self, source: PictureFeed) -> bool:
        editor, draw = self.editor, lambda: source.draw(self.editor, self._frame_ms)
        return editor.barrier.run("The picture", draw, False, (editor.document, editor.view))

    def _draw_brdf(self, now: float) -> bool:
        editor = self.editor
        draw = partial(self._brdf.draw, editor, self._surface_at, self._is_dragging, now)
        return editor.barrier.run("The BRDF's picture", draw, False, (editor.document, editor.view))

    def _surface_at(self, column: int, row: int) -> SurfacePoint | None:
        """The point of the selected object that a pixel sees."""
        source, selected = self.source, self.editor.view.selected
        point = None if source is None else source.surface_at(column, row)
        if source is None or point is None or selected is None or source.object_at(column, row) != selected.object:
            return None
        return point

    def _has_news(self, now: float) -> bool:
        shown = self._work != self._shown_work or self.looks.progress_changed
        return self.pacing.has_news(now, self.editor.status) or shown

    def _result(self, busy: bool, screenshot: Path | None, quit: bool) -> FrameResult:
        plays = self.editor.view.playing is not None
        redraw_in = REDRAW_SECONDS if plays else self.pacing.redraw_in
        draws_thumbnail = self._is_idle and self._pictures.materials.is_waiting
        follows = self._library_unread or draws_thumbnail or not self.events.is_empty
        return FrameResult(busy or self.pacing.is_settling or follows, redraw_in, screenshot, quit)

    @property
    def _work(self) -> tuple[str, str]:
        """The progress of what processes of their own do."""
        return self.saving.progress, self.actor.photos.progress

    @property
    def _is_idle(self) -> bool:
        """Whether nothing waits for a frame: neither input nor the picture."""
        return not self._is_dragging and self.editor.status.is_finished

    def _follow_view(self) -> None:
        if not self._is_dragging and self.editor.status.is_whole and self._pictures.follow_view(self.source):
            self.pacing.note_change()

    def _read_library(self) -> None:
        """Read one material per frame, once the window has drawn its first frames."""
        if self._library_unread and self.pacing.has_started:
            self._library_unread = self.actor.library.read_next()

    def _take_message(self, now: float) -> None:
        """Show the editor's message, once; the same one may come again."""
        status = self.editor.status
        question = self.state.question
        if question is not None and question.refusal and status.message.endswith(question.refusal):
            self._shown_message = status.message_number  # the file dialog shows it
        if status.message_number != self._shown_message:
            said = with_display_names(self.editor.document, status.message)
            self.state = replace(self.state, message=StatusMessage(said, now, status.is_error))
            self._shown_message = status.message_number

    def _context(self, now: float) -> PanelContext:
        handler, self._shown_work = self.actor, self._work
        return panel_context(
            self.editor, self.source, self._pictures, state=self.state, theme=self.theme, handles=self.handles,
            fields=self._fields, brdf=self._brdf_board, looks=self._look_board, record=self._record,
            environments=self.environments, scenes=self.scenes, preferences=handler.preferences.current,
            recent=handler.recent.entries, recoveries=handler.recoveries, library=handler.library.entries, now=now,
            saving=self._shown_work[0], photo=self._shown_work[1], found=handler.photos.found,
            **self.highlights.panel_fields(self.state, self.source, self._pictures.picture),
        )  # fmt: skip

    def _panels(self, context: PanelContext) -> list[Action]:
        barrier = self.editor.barrier
        actions = draw_panels(context, barrier, self._begin_space)
        if not imgui.is_key_pressed(imgui.Key.escape, False):
            return actions + (draw_guarded(barrier, "The keyboard", shortcuts.keyboard, context) or [])
        answered = shortcuts.answer_escape(context, self._escape_is_imguis, self._is_dragging)
        # The panels' actions during a drag belong to the drag, and are cancelled with it.
        return answered if CancelDrag() in answered else actions + answered

    def _begin_space(self) -> None:
        self._front = self._docking.begin_space(self.theme.scale, self.state.single_panel)
