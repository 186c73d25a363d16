"""Saves what is shown, in a file or to be compared: at once, or drawn anew with its layers or all looks."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import moderngl

from app.editor.editor import Editor
from app.stills.layer_saver import LayerSaver
from app.system.atomic import save_file
from engine.core.errors import InsituError
from engine.render.crop import Crop
from ui.gl.context import GraphicsError
from ui.panels.actions import SaveContactSheet, SavePicture, StorePicture
from ui.picture_feed import PictureFeed, ViewportStill
from ui.picture_storing import PictureStoring


class PictureSaving:
    """Saves pictures of one editor, each by a thread or a process of its own, and notifies when they are written."""

    def __init__(self, context: moderngl.Context, editor: Editor) -> None:
        self._editor = editor
        self._stills, self._layers = StillSaver(), LayerSaver()
        self._storing = PictureStoring(context, editor)

    @property
    def progress(self) -> str:
        """How far a picture with layers is, for the status bar."""
        return self._layers.progress

    @property
    def is_storing(self) -> bool:
        """Whether a picture is still to be stored."""
        return self._storing.is_under_way

    def follow(self) -> bool:
        """Take a step of what is to be stored, once a frame; returns whether there is more to do, or something new."""
        return self._storing.follow()

    def save(self, action: SavePicture | SaveContactSheet | StorePicture, source: PictureFeed | None) -> None:
        """Save what is shown now, read at once and written by a thread; or, with its layers or all looks, what is drawn
        anew."""
        if isinstance(action, StorePicture):
            self._store(action.name, source)
            return
        if isinstance(action, SaveContactSheet) or action.layers:
            is_cropped = isinstance(action, SavePicture) and action.cropped
            self._save_layers(action.path, self._editor.view.crop if is_cropped else None)
            return
        still = None if source is None else source.still(self._editor)
        if still is None:
            self._editor.notify("there is no picture yet to be saved", True)
            return
        exact = self._editor.status.picture == "exact"
        remark = "" if exact else "; it is a preview: the picture is not exact yet"
        crop = self._editor.view.crop if action.cropped else None
        self._stills.save(still, action.path, action.deep, remark, crop)

    def _store(self, name: str, source: PictureFeed | None) -> None:
        """Begin to store what is shown."""
        editor = self._editor
        shown = None if source is None else source.shown(editor)
        if shown is None:
            editor.notify("there is no picture yet to be stored", True)
            return
        try:
            self._storing.begin(name, shown)
        except (InsituError, GraphicsError) as error:
            editor.notify(str(error), True)

    def _save_layers(self, path: Path, crop: Crop | None) -> None:
        try:
            self._layers.save(self._editor.document, replace(self._editor.view, crop=crop), path)
        except InsituError as error:
            self._editor.notify(str(error), True)

    def stop(self) -> None:
        """Stop drawing pictures with layers."""
        self._layers.stop()

    def notify_finished(self) -> None:
        """Say what has been written since, or could not be."""
        for line, failed in (*self._stills.finished_messages(), *self._layers.finished_messages()):
            self._editor.notify(line, failed)

    def close(self) -> None:
        """Wait until pictures that are being written are whole; stop what is being drawn."""
        self._stills.close()
        self._layers.close()
        self._storing.close()


class StillSaver:
    """Saves pictures one after the other; their results are collected between frames."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="still")
        self._pending: list[Future[tuple[str, bool]]] = []

    def save(self, still: ViewportStill, path: Path, deep: bool, remark: str = "", crop: Crop | None = None) -> None:
        """Begin to write a picture; a remark is added to the message when it is written."""
        self._pending.append(self._thread.submit(_save, still, path, deep, remark, crop))

    def finished_messages(self) -> list[tuple[str, bool]]:
        """A line for the user for each that has ended, and whether it failed."""
        ended = [future for future in self._pending if future.done()]
        self._pending = [future for future in self._pending if not future.done()]
        return [future.result() for future in ended]

    def close(self) -> None:
        """Wait until all are written."""
        self._thread.shutdown(wait=True)


def _save(still: ViewportStill, path: Path, deep: bool, remark: str, crop: Crop | None) -> tuple[str, bool]:
    try:
        save_file(path, still.encoded(path.suffix.lower(), deep, crop))
    except (InsituError, ValueError, MemoryError) as error:
        return f"{error}", True
    return f"saved {path}{remark}", False
