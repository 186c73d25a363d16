"""Pictures in panels: the viewport's, the error map, and thumbnails of materials, maps and bookmarked views. With what
else panels read, they are the arguments of panels.

A bookmarked view gets its thumbnail when it is shown and its picture is complete: one that is bookmarked while its
picture is still coming as soon as that is there, and so does one that a session has without a thumbnail. They are drawn
from their JPEG.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.document.display_names import with_display_names
from app.document.selection import layer_shown
from app.document.view_state import Bookmark, SetView
from app.editor.editor import Editor
from app.files.bookmarks import THUMBNAIL_SIZE, with_thumbnail
from app.files.materials import LibraryEntry
from engine.core.errors import InsituError
from engine.render.scopes import Scopes, waveform_picture
from ui.brdf_feed import TableFeed
from ui.difference_feed import DifferenceFeed
from ui.gl.display import ErrorOverlay
from ui.gl.gpu_memory import TextureMemory
from ui.gl.interface import InterfaceRenderer
from ui.gl.thumbnails import Thumbnails
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.picture_feed import PictureFeed, ViewportStill
from ui.scopes import ScopeTexture
from ui.transfer_previews import TransferPreviews

QUALITY = 85
# Beyond this zoom the user inspects pixels, which are then drawn as squares.
SHARP_ZOOM = 2.0


class ViewThumbnails:
    """The textures of the visible ones, by their files."""

    def __init__(self, context: moderngl.Context) -> None:
        self._memory = TextureMemory(context)
        self._textures: dict[bytes, moderngl.Texture] = {}

    def texture(self, bookmark: Bookmark) -> moderngl.Texture | None:
        """The picture, RGBA8 with row 0 at the top; None while there is none."""
        data = bookmark.thumbnail
        if data and data not in self._textures:
            pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))
            self._textures[data] = self._memory.texture((pixels.shape[1], pixels.shape[0]), 4, "f1", pixels)
        return self._textures.get(data)

    def follow(self, editor: Editor, still: Callable[[], ViewportStill | None]) -> bool:
        """Take the complete picture, where it is of a bookmarked view that has none; returns whether there is a new
        one."""
        self._forget_unused(editor.view.bookmarks)
        is_elsewhere = editor.status.is_away and not editor.status.follows_input
        if is_elsewhere or all(bookmark.thumbnail for bookmark in editor.view.bookmarks):
            return False
        seen = editor.camera_history.camera, editor.camera_history.resolution
        for bookmark in editor.view.bookmarks:
            camera, resolution = bookmark.viewpoint
            there = camera or editor.camera_history.own_camera, resolution or editor.camera_history.own_resolution
            if not bookmark.thumbnail and there == seen and (picture := still()) is not None:
                thumbnail = jpeg_of(picture)
                editor.do(SetView.of(bookmarks=with_thumbnail(editor.view.bookmarks, bookmark.name, thumbnail)))
                return True
        return False

    def release(self) -> None:
        """Free all textures."""
        for texture in self._textures.values():
            self._memory.release(texture)
        self._textures = {}

    def _forget_unused(self, bookmarks: tuple[Bookmark, ...]) -> None:
        used = {bookmark.thumbnail for bookmark in bookmarks}
        for data in [data for data in self._textures if data not in used]:
            self._memory.release(self._textures.pop(data))


def jpeg_of(picture: ViewportStill) -> bytes:
    """A picture as it is shown, small."""
    image = Image.fromarray(np.round(255.0 * np.clip(picture.shown, 0.0, 1.0)).astype(np.uint8))
    image.thumbnail(THUMBNAIL_SIZE)
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return file.getvalue()


class PanelPictures:
    """Makes textures drawable by panels, and thumbnails while nothing else is to be done. `interface` draws them,
    `tables` are those of measured materials."""

    def __init__(
        self, context: moderngl.Context, editor: Editor, interface: InterfaceRenderer, tables: TableFeed
    ) -> None:
        self._editor, self._interface = editor, interface
        self._error_overlay = ErrorOverlay(context)
        self.materials = Thumbnails(context, tables.tables, partial(tables.complete, editor))
        self.transfers = TransferPreviews(lambda: editor.document, lambda: editor.view)
        self._views = ViewThumbnails(context)
        self._waveform = ScopeTexture(context)
        self.difference = DifferenceFeed(context, self.picture)

    def picture(self, texture: moderngl.Texture | None, sharp: bool = False) -> Picture | None:
        """A texture for panels to draw; `sharp` shows its pixels as squares where they are enlarged."""
        if texture is None:
            return None
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST) if sharp else (moderngl.LINEAR, moderngl.LINEAR)
        return Picture(self._interface.register(texture), texture.width, texture.height)

    def material(self, entry: LibraryEntry) -> Picture | None:
        """A material of the library; None while there is no picture of it."""
        return self.picture(self.materials.texture(entry))

    def view(self, bookmark: Bookmark) -> Picture | None:
        """A bookmarked view; None while there is no picture of it."""
        return self.picture(self._views.texture(bookmark))

    def error_map(self, colours: NDArray[np.uint8] | None) -> Picture | None:
        """The map of the picture's error, of colours (H, W, 4); None while it is unknown."""
        return self.picture(self._error_overlay.texture(colours))

    def waveform(self, scopes: Scopes, parade: bool) -> Picture | None:
        """A waveform, of luma or of the channels side by side."""
        return self.picture(self._waveform.show(waveform_picture(scopes.waveforms, parade)))

    def maps(self, source: PictureFeed, key: str) -> dict[str, Picture]:
        """The images of a layer, by "texture" and "weight"."""
        found = {name: self.picture(texture) for name, texture in source.map_thumbnails(key).items()}
        return {name: picture for name, picture in found.items() if picture is not None}

    def follow_view(self, source: PictureFeed | None) -> bool:
        """Take a thumbnail of the view that is shown, where its bookmark has none; returns whether there is a new
        one."""
        editor = self._editor
        return self._views.follow(editor, lambda: None if source is None else source.still(editor))

    def release(self) -> None:
        """Free all textures."""
        self.materials.release()
        self._views.release()
        self._waveform.release()
        self.difference.release()
        self._error_overlay.release()


def panel_context(editor: Editor, source: PictureFeed | None, pictures: PanelPictures, **window: Any) -> PanelContext:
    """What panels read in this frame: of the editor, of the picture's `source`, and the `window`'s own fields of
    `PanelContext`."""
    document, status, history = editor.document, editor.status, editor.camera_history
    undo, redo = editor.undo_label, editor.redo_label
    context = PanelContext(
        document=document,
        view=editor.view,
        mode=editor.mode,
        modes=editor.modes,
        status=replace(
            status,
            text=with_display_names(document, status.text),
            missing_note=with_display_names(document, status.missing_note),
        ),
        undo_label=undo and with_display_names(document, undo),
        redo_label=redo and with_display_names(document, redo),
        scene_document=editor.scene_document,
        name=editor.session.name,
        catalogues=editor.colours.catalogues,
        unsaved=editor.session.is_unsaved,
        report=editor.scenes.report,
        camera=history.camera,
        own_camera=history.own_camera,
        own_resolution=history.own_resolution,
        camera_undo_label=editor.camera_undo_label,
        camera_redo_label=editor.camera_redo_label,
        box_of=partial(_box_of, editor),
        resting_box_of=history.resting_box,
        view_thumbnail=pictures.view,
        thumbnail=pictures.material,
        transferred=pictures.transfers.entries,
        stored_names=editor.stored.names,
        stored_names_of=editor.stored.names_of,
        reads_stored=editor.stored.is_reading,
        **window,
    )
    if source is None:
        return context
    selected, refusal = layer_shown(document, editor.view.selected), None
    sharp = not editor.view.fit and editor.view.zoom > SHARP_ZOOM
    if selected is not None:
        refusal = source.map_refusal(editor, selected.key) or editor.nodes.refusal(document.layer(selected.key))
    return replace(
        context,
        status=replace(context.status, is_away=status.is_away or source.shows_view_before),
        picture=pictures.picture(source.picture, sharp),
        difference=pictures.difference.board(sharp),
        picture_camera=source.camera,
        mode_before="" if source.mode_before is None else source.mode_before.title,
        error_overlay=pictures.error_map(status.error_colours),
        environment=pictures.picture(source.environment),
        has_environment=source.has_environment,
        map_thumbnails={} if selected is None else pictures.maps(source, selected.key),
        map_refusal=refusal,
        heading=source.heading,
        object_at=source.object_at,
        objects_in=source.objects_in,
        spot_at=source.spot_at,
        facing_of=editor.camera_history.resting_facing,
        values_at=partial(source.values_at, editor),
        scopes=lambda: source.scopes(editor, editor.view.crop),
        waveform=pictures.waveform,
    )


def _box_of(editor: Editor, name: str | None) -> NDArray[np.float64] | None:
    try:
        return editor.camera_history.box_of(name)
    except InsituError:
        return None
