"""The scene that is open, the one that is being opened, and the view of it that the worker traces.

A scene is opened alone, or for a session or a journal. The open scene stays until the next one is loaded and traced.
The mode decides what a picture of it needs; this notifies the mode's controller of every scene and every traced view.
A scene is opened once, by a command of the user: there is no desired state to come back to, and so no `Reconciler` but
that of its views.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from app.document.commands import EditCommand
from app.document.commands.light import set_environment_file
from app.document.document import Document, Selection
from app.document.history import History
from app.document.named_files import files_of_document
from app.document.scene_change import SceneChange, matching_parts
from app.document.scene_files import Up, split_axis, with_axis, with_variants
from app.document.selection import initial_selection
from app.document.timeline import visible_poses
from app.document.view_state import ViewState
from app.editor.camera_history import CameraHistory
from app.editor.composition_controller import CompositionController, CompositionHost, FittedScene, added_states
from app.editor.node_controller import NodeController
from app.editor.opening import Opening
from app.editor.view_controller import TracedView, ViewController, describe_empty_frame
from app.files.bookmarks import MAX_BOOKMARKS, camera_bookmarks
from app.files.journal import SessionStore
from app.files.session import Session
from app.files.session_fitting import session_notes
from app.messages.editor_status import StatusMetrics
from app.messages.picture_events import PictureEvent, SceneFrame, SkyChanged
from app.messages.worker_messages import Request, RequestFailed, SceneOpened, SkyImage, ViewTraced
from app.modes.mode import ModeController, OpenedScene
from app.system.atomic import add_inputs, set_inputs
from app.system.file_watch import FileWatch
from engine.core.errors import InsituError, list_names
from engine.scene.builtin import DEFAULT_SCENE
from engine.scene.description import SceneDescription
from engine.scene.import_report import ImportReport


class SceneHost(CompositionHost, Protocol):
    """What the scene controller needs of the editor."""

    history: History[Document]
    metrics: StatusMetrics
    camera_history: CameraHistory
    nodes: NodeController
    resolution: tuple[int, int] | None

    @property
    def scene_is_open(self) -> bool: ...

    def send(self, request: Request) -> int: ...

    def open(self, source: str) -> str | None: ...

    def do(self, command: EditCommand) -> str | None: ...

    def select(self, path: str | Selection | None) -> str | None: ...

    def document_changed(self, before: Document | None = None) -> None: ...

    def picture_voided(self, notes: tuple[str, ...]) -> None: ...

    def take_failure(self, response: RequestFailed) -> None: ...


class SceneController:
    """Opens and traces scenes. `tracing` requests views; `opened`: the scene as it is open, None before the first;
    `report`: what its files contain; `watch`: notices when another program has written them; `n_opened`: how many were
    opened, files that are read again not counted."""

    def __init__(self, host: SceneHost, keeper: SessionStore) -> None:
        self._host, self._keeper = host, keeper
        self.tracing = ViewController(host.send)
        self.composing = CompositionController(host, self.tracing)
        self.opened: OpenedScene | None = None
        self.report = ImportReport()
        self.watch = FileWatch()
        self.n_opened = 0
        self._shown: list[PictureEvent] = []
        self._opening: Opening | None = None
        self._given_up: Opening | None = None

    def open(self, opening: Opening) -> None:
        """Request that a scene is loaded and traced."""
        host = self._host
        host.controller.scene_closed()
        id = host.send(opening.request(self.composing.sources if opening.present else ()))
        self.tracing.request_view(opening.first_view(id, host.resolution, host.view))
        self._opening = replace(opening, id=id)
        host.metrics.progress = None

    def reload(self) -> str | None:
        """Read the files of the open scene again; edits stay (`app.document.scene_change`). A session that another
        program has written is opened instead, where nothing would be lost.

        Returns None, or one line that says why not.
        """
        host = self._host
        if self._keeper.file_has_changed and self._keeper.path is not None:
            if not self._keeper.unsaved(host.document, host.view):
                return host.open(str(self._keeper.path))
            host.notify(f"{self._keeper.path}: written elsewhere, and there are unsaved edits here; these stay", True)
        return self._read_again(self._source)

    def turn_up(self, up: Up | None = None) -> str | None:
        """Open the mesh again with this axis up, the other one by default; edits stay. Returns as `reload`."""
        now = split_axis(self._source)[1]
        return self._read_again(with_axis(self._source, up or ("y" if now == "z" else "z")))

    def choose_variants(self, chosen: Mapping[str, str]) -> str | None:
        """Open the stage again with these variants, by the names of their sets; edits stay. Returns as `reload`."""
        return self._read_again(with_variants(self._source, chosen))

    @property
    def _source(self) -> str:
        """The scene that is open, or that is being opened."""
        return self._host.document.source if self._opening is None else self._opening.source

    def _read_again(self, source: str) -> str | None:
        """Open the present scene again under this name; not while another one is being opened."""
        host, opening = self._host, self._opening
        if opening is not None and opening.present is None:
            line = f"{opening.file} is being opened; its files are read now"
            host.notify(line, True)
            return line
        self.open(Opening(0, source, present=(host.document, host.view)))
        return None

    def open_default(self, why: str) -> None:
        """Open the built-in scene where nothing is open, so that the window is of use; `why` is shown."""
        if not self._host.scene_is_open and self._opening is None:
            self.open(Opening.of(DEFAULT_SCENE, f"{why} - the built-in {DEFAULT_SCENE} is open instead"))

    def give_up(self) -> None:
        """Forget what was being opened or traced: the work was stopped."""
        self._given_up, self._opening = self._opening, None
        self._give_up_view(self._given_up)

    def reopen(self) -> bool:
        """Open what `give_up` dropped, where no other scene is open, or trace the view that waits; returns whether the
        mode has to wait for that."""
        self.tracing.retry()
        if self.composing.is_waiting:
            return True
        if self._given_up is None or self._host.scene_is_open:
            return False
        self.open(self._given_up)
        return True

    def update(self, now: float, view: ViewState) -> None:
        """Request that the scene is traced once view and poses are idle; once a frame. view: the host's, with effective
        settings."""
        document = self._host.document
        desired = TracedView(
            view.viewpoint, visible_poses(document, self._host.view), document.new_bumps, view.settings.n_edge_rays,
            opacities=document.new_opacities, composition=document.composition,
        )  # fmt: skip
        if self._opening is None:
            self.composing.update(now, desired)

    def announce_scene(self, controller: ModeController) -> list[PictureEvent]:
        """Announce the open scene to another mode's controller as if it had just come; returns events for its
        picture."""
        if self.opened is None:
            return []
        pictured = self._host.with_nodes(self.composing.drawn(self._host.document))
        controller.scene_opened(replace(self.opened, document=pictured))
        if self._opening is not None or self.composing.is_waiting:
            controller.scene_closed()
        elif self.tracing.is_away:
            controller.view_moved()
        return list(self._shown)

    # -------------------------------------------------------------------------------------------------------- responses

    def take_loaded(self, response: SceneOpened) -> None:
        """A scene was loaded: it is open once it is traced."""
        opening = self._opening
        if opening is None or response.id != opening.id:
            return
        if response.has_session and opening.edited is None:
            refusal = self._host.open(opening.source)  # the archive is unpacked now, and its session can be read
            if refusal is None:
                return
            opening = replace(opening, fallback_reason=f"opened the scene without its session: {refusal}")
        self._opening = opening = self._fitted(replace(opening, opened=response), response)
        fitted = opening.fitted
        if fitted is not None and fitted.document.composition != self.tracing.requested_composition:
            view = opening.first_view(response.id, self._host.resolution, self._host.view)
            self.tracing.request_view(view._replace(composition=fitted.document.composition))

    def _fitted(self, opening: Opening, opened: SceneOpened) -> Opening:
        """The opening of a scene that was loaded, with the document that it is opened with: the first view is of its
        objects."""
        description = SceneDescription.model_validate_json(opened.description)
        try:
            described, added = opening.document(description, opened), added_states(opened.added)
        except InsituError as error:
            self._host.take_failure(RequestFailed(str(error), id=opened.id))
            return opening
        if opening.present is not None:
            before, own = self.composing.own or (description, described)
            names = matching_parts(before, self.report, description, opened.report)
            change = SceneChange(own, described, names, self.composing.added, added)
            fitted = FittedScene(description, described, change(opening.present[0]))
            return replace(opening, fitted=fitted, change=change)
        document = described
        if opening.session is not None:
            with suppress(InsituError):  # then it is opened without its session, which is said once it is traced
                document = opening.restored(opening.session, described, opened, added)
        return replace(opening, fitted=FittedScene(description, described, document))

    def take_sky(self, response: SkyImage) -> list[PictureEvent]:
        """The image of the sky behind the scene has come."""
        self._host.metrics.note(*response.notes)
        self.report = replace(self.report, notes=tuple(dict.fromkeys((*self.report.notes, *response.notes))))
        sky = SkyChanged(response.radiance)
        self._shown = [*self._shown[:1], sky]
        return self._host.controller.sky_changed(sky)

    def take_traced(self, response: ViewTraced) -> list[PictureEvent]:
        """The scene was traced: one that is being opened is open now."""
        is_awaited = self.tracing.note_traced(response)
        opening = self._opening
        if response.missing and self.opened is not None and opening is None:
            self._leave_out(response, is_awaited)
        if not is_awaited:
            self._report_missing(response)
            return []
        if opening is not None and opening.opened is not None and opening.fitted is not None:
            events = self._take_scene(opening, opening.opened, opening.fitted, response)
            self._report_flaws(response)
            return events
        assert self.opened is not None
        host = self._host
        host.picture_voided(self.opened.notes)
        host.view = host.view.from_viewpoint(host.view.viewpoint)  # the camera may have moved on
        if self.composing.has_new_objects:
            host.controller.scene_opened(self._view_traced(self.composing.take_objects(self.opened), response))
        else:
            scene = replace(self.opened, document=host.with_nodes(self.composing.drawn(host.document)))
            host.controller.view_traced(self._view_traced(scene, response))
        host.document_changed()
        if self.tracing.has_resized:
            width, height = self.tracing.traced.resolution or host.camera_history.own_resolution
            host.notify(f"the picture has {width} x {height} pixels")
        if missing := describe_empty_frame(response.frame):
            host.notify(missing)
        self._report_flaws(response)
        self._report_missing(response)
        return self._shown

    def take_failure(self, response: RequestFailed) -> None:
        """A scene could not be opened or traced."""
        opening = self._opening
        if opening is not None and response.id == opening.id or self.tracing.is_pending(response.id):
            self._opening = None
            self._give_up_view(opening)
            if opening is not None and opening.source != DEFAULT_SCENE:
                self.open_default(response.line)

    def _leave_out(self, response: ViewTraced, is_awaited: bool) -> None:
        """Objects whose files cannot be read are absent from now on, and wait for these with all edits. is_awaited:
        whether the view is the newest; else a new worker has traced again what the picture shows."""
        host, before = self._host, self._host.document
        self.composing.leave_out(response.missing, is_awaited)
        host.document_changed(before)

    def _report_missing(self, response: ViewTraced) -> None:
        if response.problems:
            self._host.notify("; ".join((*response.problems, "its objects wait for it, with all edits")), True)

    def _take_scene(
        self, opening: Opening, opened: SceneOpened, fitted: FittedScene, response: ViewTraced
    ) -> list[PictureEvent]:
        host = self._host
        if opening.change is not None:
            return self._take_again(opening.change, fitted, opened, response)
        self.n_opened += 1
        left_unsaved = self._keeper.leave_document(host.document, host.view)
        self._note_files(fitted, opened)
        description, described, _ = fitted
        views = camera_bookmarks(opened.cameras, description.camera.resolution)
        host.view = replace(host.view.for_scene(description), bookmarks=views)
        host.history = History(described)
        host.nodes.scene_opened(opened.channels, opened.nodes)
        self._keeper.set_document(described, host.view)
        kept = "; the unsaved edits before it can be recovered at the next start" if left_unsaved else ""
        said = opening.fallback_reason or f"opened {description.name}{kept}"
        said = "; ".join(filter(None, (said, *opened.notes, describe_empty_frame(response.frame))))
        host.notify(said, bool(opening.fallback_reason))
        if opening.session is not None:
            self._restore(opening, opening.session, opened)
        self.add_files(files_of_document(host.document) | ({opening.session_path} if opening.session_path else set()))
        host.view = host.view.from_viewpoint(self.tracing.adopt_resolution(host.camera_history.own_resolution))
        host.camera_history.reset_history()
        self._announce(fitted, opened, response)
        if host.view.selected is None and host.view.sun is None:
            host.select(initial_selection(host.document))
        if opening.light is not None:
            host.do(set_environment_file(opening.light))
        return self._shown

    def _announce(self, fitted: FittedScene, opened: SceneOpened, response: ViewTraced) -> None:
        """Tell the mode of a scene that was opened."""
        scene = OpenedScene(0, opened.planned, fitted.description, fitted.described, fitted.document, opened.notes)
        self._host.controller.scene_opened(self._view_traced(self.composing.take_objects(scene), response))

    def _note_files(self, fitted: FittedScene, opened: SceneOpened) -> None:
        """Note what a scene was read from that is open from now on, and what is in it."""
        self._host.picture_voided(opened.notes)
        self._opening = None
        self._host.camera_history.scene_opened(fitted.description, opened.boxes)
        self._host.camera_history.add_boxes(opened.added)
        self.composing.open_scene(fitted, opened.added)
        self.report = opened.report
        set_inputs(map(Path, opened.files))
        self.watch.watch(opened.files)

    def add_files(self, files: set[Path]) -> None:
        """Note files that the document names besides."""
        add_inputs(files)
        self.watch.add(files)

    def _take_again(
        self, change: SceneChange, fitted: FittedScene, opened: SceneOpened, response: ViewTraced
    ) -> list[PictureEvent]:
        """The files of the open scene were read again: the whole history goes on with them."""
        host, description = self._host, fitted.description
        known = {each.name for each in host.view.bookmarks} | set(self.report.cameras)
        new = [each for each in opened.cameras if each.name not in known]
        views = camera_bookmarks(new, description.camera.resolution)
        host.view = replace(host.view, bookmarks=(*host.view.bookmarks, *views)[:MAX_BOOKMARKS])
        gone = [name for name in change.gone(host.document) if all(name != each.name for each in host.document.absent)]
        parts = change.lost_parts(host.document)
        self._note_files(fitted, opened)
        host.history.map(change)
        self._keeper.map(change)
        if host.view.compare is not None:
            host.view = replace(host.view, compare=change(host.view.compare))
        self.watch.add([self._keeper.path] if self._keeper.path else [])
        host.view = host.view.from_viewpoint(self.tracing.adopt_resolution(host.camera_history.own_resolution))
        host.nodes.scene_opened(opened.channels, opened.nodes)
        self._announce(fitted, opened, response)
        self._select_again(change)
        host.document_changed()
        waiting = {state.name for state in host.document.absent}
        kept, lost = [name for name in gone if name in waiting], [name for name in gone if name not in waiting]
        said = (
            f"reloaded {description.name}",
            f"no longer there: {list_names(kept)}, whose edits wait for them" if kept else "",
            f"edits of {list_names(lost)} are lost: another part has that number now" if lost else "",
            f"edits of {list_names(parts)} are lost: the file has nothing of that name now" if parts else "",
        )
        host.notify("; ".join((*filter(None, said), *opened.notes)), bool(gone or parts))
        return self._shown

    def _select_again(self, change: SceneChange) -> None:
        """Keep the selected object selected, under its name of now; another one where it is gone."""
        host, selected = self._host, self._host.view.selected
        if selected is None:
            return
        name = change.name_now(selected.object) or selected.object
        there = {state.name for state in host.document.objects}
        if name in there:
            others = tuple(change.name_now(each) or each for each in host.view.others)
            others = tuple(each for each in others if each in there and each != name)
            host.view = replace(host.view, selected=selected._replace(object=name), others=others)
        else:
            host.select(initial_selection(host.document))

    def _restore(self, opening: Opening, session: Session, opened: SceneOpened) -> None:
        """Replace the scene's document and view by a session's, where they fit."""
        host, scene = self._host, self._host.document
        try:
            document = opening.restored(session, scene, opened, self.composing.added)
        except InsituError as error:
            host.notify(f"opened the scene without its session: {error}", True)
            return
        host.history = History(document)
        host.view = replace(session.view, panels=host.view.panels)
        self._keeper.set_document(document, host.view, opening.session_path, opening.recovery, opening.digest)
        said = "recovered what was not saved" if opening.recovery else f"opened {opening.file}"
        notes = session_notes(session, scene, self.composing.added)
        self.report = replace(self.report, notes=(*self.report.notes, *notes))
        host.notify("; ".join((said, *notes)), bool(notes))

    def _view_traced(self, scene: OpenedScene, seen: ViewTraced) -> OpenedScene:
        """Note a traced view; the renderer is to be notified of it."""
        described = scene.description.from_camera(self.tracing.traced.camera)
        self._shown = [SceneFrame(self.tracing.scene, scene.document.source, described, seen.frame)]
        self.opened = scene = replace(scene, view_id=seen.id, poses=self.tracing.poses)
        return scene

    def _report_flaws(self, response: ViewTraced) -> None:
        """Report which bumps are not shown, and why."""
        if response.flaws:
            self._host.notify("; ".join(response.flaws), True)
            self._host.metrics.note(*response.flaws)

    def _give_up_view(self, opening: Opening | None) -> None:
        """Note that a view cannot be traced: return to the one that the picture shows, unless the camera has moved on
        since."""
        host = self._host
        requested = self.tracing.give_up()
        if requested is None or not host.scene_is_open:
            return
        stays = opening is None and requested == host.view.viewpoint and not host.camera_history.history.dragging
        if stays:  # else the camera has moved on and is traced from there
            host.camera_history.restore_viewpoint(self.tracing.traced)
        if opening is not None:
            host.controller.scene_open_failed()
        elif not self.composing.is_waiting:  # else the mode's scene stays closed
            host.controller.view_restored()
