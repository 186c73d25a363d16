"""Has the pictures of looks drawn that panels show (`ui.panels.look_board`), and makes textures of them.

A picture that came is linear light; exposure and view transform apply to it as to the one that is edited. Where a look
that was edited has no picture yet, a copy of what was on screen stands for it. After a switch the finished picture of
the look stands for the one that is edited, until that is finished as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.editor.editor import Editor
from app.messages.editor_status import HeldByLooks
from app.stills.look_pictures import LookPicture, LookPictures, LookView, look_alone
from ui.gl.context import GraphicsError
from ui.gl.display import DisplayView, draw_on_screen
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes
from ui.gl.view_transform import ToneMapper, ToneView
from ui.modes.placement.placement_feed import inspection
from ui.panels.look_board import LookBoard
from ui.panels.pictures import Picture
from ui.picture_feed import CopiedPicture

# A pane's picture has one of so many shares of the resolution, so that a border that is moved draws few of them anew.
STEPS = 8
PATIENCE_S = 5.0


@dataclass(eq=False)
class _Shown:
    """The textures of a picture: its linear light, and how that is shown in a view."""

    of: LookPicture
    linear: moderngl.Texture
    texture: moderngl.Texture
    view: DisplayView | None = None


class LookFeed:
    """Follows the board and the editor. make_picture: makes a texture drawable by panels."""

    def __init__(
        self, context: moderngl.Context, board: LookBoard,
        make_picture: Callable[[moderngl.Texture | None], Picture | None],
    ) -> None:  # fmt: skip
        self._context, self._board, self._make_picture = context, board, make_picture
        self._memory, self._passes = TextureMemory(context), Passes(context)
        self._mapper, self._tone = ToneMapper(self._passes, self._memory), ToneView()
        self.pictures = LookPictures()
        self._shown: dict[str, _Shown] = {}
        self._copies: dict[str, CopiedPicture] = {}
        self._document: Document | None = None
        self._switched_to: Document | None = None
        self._was_whole = False  # whether the picture on screen is that of the document before this frame's edits

    def note_switch(self, editor: Editor, picture: moderngl.Texture | None) -> None:
        """Note which look is current, before the picture follows: of one that was left a copy of it stays."""
        document, before = editor.document, self._document
        self._document = document
        if before is None or before is document or not self._board.shown or before.source != document.source:
            return
        if document is not self._switched_to:
            self._switched_to = None
        if before.look != document.look and document.looks:
            self._switched_to = document
            if picture is not None and self._was_whole:
                self._drop_copy(before.look)
                try:
                    self._copies[before.look] = CopiedPicture(self._context, picture)
                except GraphicsError:
                    pass  # the pane is empty until its look is drawn

    def follow(self, editor: Editor, now: float) -> bool:
        """Have what panels show drawn, and update their pictures; once a frame. Returns whether there is something
        new."""
        board, pictures = self._board, self.pictures
        self._was_whole = editor.status.is_whole
        views = _views(editor, board.shown)
        others = {name: view for name, view in views.items() if name != editor.document.look}
        pictures.want(now, others)
        is_new = pictures.take()
        pictures.want(now, others)
        editor.metrics.looks = self._held()
        if not views:
            self._forget()
            return is_new
        try:
            for name in views:
                is_new |= self._draw(editor, name)
        except GraphicsError as error:
            editor.notify(str(error), True)
        board.pictures = {name: found for name in others if (found := self._picture_of(name)) is not None}
        board.states = {name: pictures.state(name) for name in others}
        board.outdated = frozenset(name for name in others if name not in self._shown or pictures.is_outdated(name))
        board.stand_in = self._stand_in(editor, views)
        board.progress, board.is_stopped = pictures.progress, pictures.is_stopped
        return is_new or self._tone.waits

    @property
    def has_news(self) -> bool:
        """Whether a picture has come, or the next one is to be begun."""
        return self.pictures.take() or self.pictures.is_due

    @property
    def progress_changed(self) -> bool:
        """Whether the panels show another progress."""
        return self.pictures.progress != self._board.progress

    def close(self) -> None:
        """End the drawing, and free all textures."""
        self.pictures.close(PATIENCE_S)
        self._forget()
        self._mapper.release()
        self._passes.release()

    def _held(self) -> HeldByLooks:
        """What all of it holds."""
        process, copies = self.pictures.process, sum(each.n_bytes for each in self._copies.values())
        processes = () if process is None else (process,)
        return HeldByLooks(processes, self.pictures.n_bytes, self._memory.bytes_in_use + copies)

    def _draw(self, editor: Editor, name: str) -> bool:
        """Upload a picture that came, and draw it as the display settings say; returns whether it changed."""
        picture, shown = self.pictures.pictures.get(name), self._shown.get(name)
        if picture is None:
            return False
        if shown is None or shown.of is not picture:
            self._drop(name)
            self._drop_copy(name)
            height, width = picture.radiance.shape[:2]
            linear = self._memory.texture((width, height), 4, "f4", _with_alpha(picture.radiance))
            shown = _Shown(picture, linear, self._memory.texture((width, height), 4, "f1"))
            self._shown[name] = shown
        is_transparent = picture.radiance.shape[2] == 4
        view = DisplayView(
            editor.view.exposure, self._tone.follow(editor.view.tone_mapping, editor.colours),
            behind=None if is_transparent else (0.0, 0.0, 0.0), **inspection(editor.view),
        )  # fmt: skip
        if view == shown.view:
            return False
        target = self._memory.framebuffer([shown.texture])
        draw_on_screen(self._passes, self._mapper, target, shown.linear, view, (0, 0, *shown.texture.size))
        self._memory.release_framebuffer(target)
        shown.view = view
        return True

    def _picture_of(self, name: str) -> Picture | None:
        shown, copy = self._shown.get(name), self._copies.get(name)
        if shown is not None:
            return self._make_picture(shown.texture)
        return None if copy is None else self._make_picture(copy.picture)

    def _stand_in(self, editor: Editor, views: Mapping[str, LookView]) -> Picture | None:
        """The finished picture of the current look after a switch to it, until the one on screen is finished."""
        look = editor.document.look
        picture = self.pictures.pictures.get(look)
        if editor.status.is_finished or self._switched_to is not editor.document:
            self._switched_to = None
            return None
        if picture is None or picture.is_coarse or picture.of != views.get(look) or look not in self._shown:
            return None
        return self._make_picture(self._shown[look].texture)

    def _drop(self, name: str) -> None:
        shown = self._shown.pop(name, None)
        if shown is not None:
            self._memory.release(shown.linear)
            self._memory.release(shown.texture)

    def _drop_copy(self, name: str) -> None:
        if (copy := self._copies.pop(name, None)) is not None:
            copy.close()

    def _forget(self) -> None:
        """Free the textures; what was drawn stays, for when it is shown again."""
        for name in [*self._shown]:
            self._drop(name)
        for name in [*self._copies]:
            self._drop_copy(name)
        self._board.pictures, self._board.states, self._board.stand_in, self._board.progress = {}, {}, None, ""


def _views(editor: Editor, shown: Mapping[str, tuple[int, int]]) -> dict[str, LookView]:
    """What is to be drawn of the looks on screen, in the resolution that their places require."""
    if not editor.scene_is_open or not shown:
        return {}
    history, names = editor.camera_history, [each.name for each in editor.document.looks]
    width, height = editor.view.resolution or history.own_resolution
    found = {}
    for name, (across, down) in shown.items():
        if name in names:
            share = min(across / width, down / height, 1.0)
            steps = min(max(int(np.ceil(share * STEPS)), 1), STEPS)
            size = max(round(width * steps / STEPS), 1), max(round(height * steps / STEPS), 1)
            document = look_alone(editor.document, name)
            found[name] = LookView(document, history.camera, size, editor.view.settings, editor.scenes.tracing.scene)
    return found


def _with_alpha(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """A picture (H, W, 3 or 4) with alpha."""
    if radiance.shape[2] == 4:
        return np.ascontiguousarray(radiance)
    return np.concatenate([radiance, np.ones_like(radiance[..., :1])], axis=2)
