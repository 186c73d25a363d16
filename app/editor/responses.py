"""Takes the worker's responses to those who wait for them: controllers of the editor, or of its mode."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.messages.catcher_messages import CatcherLightFound, CatcherProgress
from app.messages.file_messages import (
    ChannelsRead,
    ColourViewRead,
    CurveTableRead,
    FilesWritten,
    MaterialsRead,
    MeasurementsRead,
    ObjectsRead,
    PictureRead,
)
from app.messages.light_path_messages import LightPathTraced
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import (
    Progress,
    RequestFailed,
    Response,
    SceneOpened,
    SkyImage,
    TableFetched,
    ViewTraced,
    WorkerRestarted,
    WorkerWarnings,
)

if TYPE_CHECKING:
    from app.editor.editor import Editor


def take_response(editor: Editor, response: Response) -> list[PictureEvent]:
    """Process a response; returns what the renderer needs of it."""
    match response:
        case SceneOpened():
            editor.scenes.take_loaded(response)
        case ViewTraced():
            events = editor.scenes.take_traced(response)
            editor.light_paths.view_traced()
            return events
        case Progress():
            if response.id > editor.cancelled_up_to:  # else it was under way when the work was stopped
                editor.metrics.progress = response
        case RequestFailed():
            editor.take_failure(response)
        case MeasurementsRead() | MaterialsRead():
            editor.metrics.progress = None
            editor.exchange.take_material(response, editor.history.dragging)
        case ObjectsRead():
            editor.metrics.progress = None
            editor.camera_history.add_boxes(response.objects)
            objects = editor.scenes.composing.add(response.objects)
            editor.exchange.take_objects(response, objects, editor.history.dragging)
        case CurveTableRead():
            editor.exchange.take_table(response, editor.history.dragging)
        case TableFetched():
            editor.metrics.progress = None
            editor.tables.receive(response)
        case ColourViewRead():
            editor.colours.receive(response)
        case PictureRead():
            editor.stored.receive(response)
        case LightPathTraced():
            editor.light_paths.receive(response)
        case ChannelsRead():
            editor.nodes.receive(response)
        case CatcherLightFound() | CatcherProgress():
            return editor.catchers.receive(response)
        case FilesWritten():
            editor.metrics.progress = None
            editor.exchange.take_written(response)
        case WorkerWarnings():
            editor.metrics.note(*response.lines)
            editor.notify("; ".join(response.lines), True)
        case SkyImage() if response.id == editor.scenes.tracing.id:
            return editor.scenes.take_sky(response)
        case WorkerRestarted():
            editor.controller.worker_restarted()
            editor.colours.worker_restarted()
            editor.stored.worker_restarted()
            editor.light_paths.worker_restarted()
            editor.notify(
                f"computing stopped ({response.reason}) and was started again; your edits are untouched", True
            )
        case _:
            return editor.controller.receive(response)
    return []
