"""Updates what the BRDF panel shows: the selected layer's curves on the GPU, and the parts that are on screen; brings
tables of measurements from the worker to the GPU.

One part is made per frame, the one made longest ago: each takes some ms on a software rasterizer. During a drag, parts
take no more than a quarter of the time, so that the picture's frames stay short; the rest follows when the user is
idle. Before the first picture nothing is made: the processors are the worker's. A driver compiles a program when a
model is shown for the first time, on llvmpipe for 20 to 90 ms until Mesa has it on disk. Measured layers are shown by
their curves alone until their tables have come, and the board says so.

    panel with a measured layer ─► `want` ─► editor.tables ─► worker ─► `advance`, between frames ─► textures

Allocating a table's 17.5 MB takes as long as a frame's panels where the processor draws, some 12 ms, so neither it nor
a piece of its upload is part of a frame.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.document import Document, all_factors, layer_key
from app.document.linked_layers import Layers, linked_indices
from app.document.named_files import measurement_in, with_measurements
from app.document.node_layers import NodeCount, layers_at_nodes, picked_node
from app.document.selection import layer_shown
from app.document.view_state import ViewState
from app.editor.editor import Editor
from engine.core.errors import InsituError
from engine.material.layer import Layer
from engine.measured.measurement import Measurement
from ui.gl import brdf_views
from ui.gl.brdf_stack import BrdfStack
from ui.gl.brdf_views import LitSphere
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory
from ui.gl.measured_tables import MeasuredTables
from ui.gl.program import Passes
from ui.gl.view_transform import DrawnView, ToneView
from ui.panels.pictures import BrdfBoard, Part, Picture
from ui.surface_lobe import SurfacePoint, surface_lobe

# The share of the time that parts may take during a drag.
EDITING_SHARE = 0.25
# The sphere and the albedo's sums are drawn in as many rows at a time as take about this long.
ROWS_SECONDS, LEAST_ROWS, LEAST_ALBEDO_ROWS = 0.010, 4, 4
ANISOTROPIC = "the measurement is anisotropic"

SurfaceAt = Callable[[int, int], SurfacePoint | None]


class BrdfFeed:
    """Feeds one board. `picture` makes a texture drawable by panels; `tables` are the window's."""

    def __init__(
        self, context: moderngl.Context, board: BrdfBoard, picture: Callable[[moderngl.Texture], Picture | None],
        tables: TableFeed,
    ) -> None:  # fmt: skip
        self._context, self._board, self._picture = context, board, picture
        self._passes, self._memory = Passes(context), TextureMemory(context)
        self._tables, self._view = tables, ToneView()
        self._tone_mapping: DrawnView = "filmic"
        self._stack = BrdfStack(self._passes, self._memory, tables.tables)
        self._sphere: LitSphere | None = None
        self._retired: LitSphere | None = None
        self._slice: brdf_views.Slice | None = None
        self._albedo: brdf_views.AlbedoShares | None = None
        self._drawn_inputs: dict[Part, tuple[object, ...]] = {}
        self._made_at: dict[Part, int] = {}
        self._n_made = 0
        self._paused_until = -math.inf
        self._surface_at: SurfaceAt = no_surface
        self._begun_for: dict[Part, tuple[object, ...]] = {}
        self._paced_for: tuple[object, ...] = ()
        self._rows, self._albedo_rows = LEAST_ROWS, LEAST_ALBEDO_ROWS

    def draw(self, editor: Editor, surface_at: SurfaceAt, is_dragging: bool, now: float) -> bool:
        """Make the part that is due, where there is time; returns whether another frame would show more.

        `surface_at` returns the point of the selected object that a pixel (column, row) of the picture sees.
        """
        if self._retired is not None:
            self._retired.release()
            self._retired = None
        self._surface_at, self._tone_mapping = surface_at, self._view.follow(editor.view.tone_mapping, editor.colours)
        layers = shown_layers(editor.document, editor.view, editor.status.map_nodes)
        self._want_tables(editor, layers)
        part = self._next_part(layers, editor)
        if part is None:
            return False
        if is_dragging and now < self._paused_until:
            return True
        started = time.perf_counter()
        try:
            self._stack.set_layers(layers)
            self._pace(layers)
            self._make(part, editor.view)
            self._board.problem = ""
        except InsituError as error:
            self._board.problem = str(error)
        self._context.finish()
        self._paused_until = now + (time.perf_counter() - started) * (1.0 / EDITING_SHARE - 1.0)
        self._n_made += 1
        self._made_at[part] = self._n_made
        self._note_answered(part, layers, editor.view)
        return self._next_part(layers, editor) is not None

    def close(self) -> None:
        """Free GL objects."""
        for thing in (self._retired, self._sphere, self._slice, self._albedo, self._stack, self._passes):
            if thing is not None:
                thing.release()

    def _want_tables(self, editor: Editor, layers: Layers) -> None:
        """Request the tables of what is on screen, and note which are missing."""
        measured: list[Measurement] = []
        if self._board.shown and editor.status.picture != "waiting":
            found = (measurement_in(layer) for layer in layers)
            measured = [each for each in found if each is not None and each.is_read]
        self._tables.want(editor, measured)
        is_anisotropic = any(each.is_anisotropic for each in measured)
        self._board.curves_alone = is_anisotropic or bool(self._tables.missing(measured))
        self._board.why_alone = self._tables.problem_of(editor, measured) or (ANISOTROPIC if is_anisotropic else "")

    def _next_part(self, layers: Layers, editor: Editor) -> Part | None:
        """The part on screen that is out of date, or not smooth yet."""
        board = self._board
        if not layers:
            board.clear()
            self._drawn_inputs.clear()
            return None
        if editor.status.picture == "waiting":
            return None
        due = [p for p in board.shown if self._drawn_inputs.get(p) != self._inputs_of(p, layers, editor.view)]
        if due:
            return min(due, key=lambda part: (self._made_at.get(part, 0), part))
        unfinished = self._sphere is not None and not self._sphere.finished and not board.problem
        return "sphere" if unfinished and "sphere" in board.shown else None

    def _note_answered(self, part: Part, layers: Layers, view: ViewState) -> None:
        """Note what a finished part shows: the document and view as they were when its first step began."""
        if self._board.problem:
            self._drawn_inputs[part] = self._inputs_of(part, layers, view)
        elif not (part == "albedo" and self._albedo is not None and self._albedo.is_begun):
            begun_for = self._begun_for.get(part) if part in ("sphere", "albedo") else None
            self._drawn_inputs[part] = begun_for or self._inputs_of(part, layers, view)

    def _inputs_of(self, part: Part, layers: Layers, view: ViewState) -> tuple[object, ...]:
        """All that a part depends on."""
        what = layers, self._board.curves_alone
        match part:
            case "sphere":
                return what, self._board.sphere_side, self._tone_mapping
            case "lobe":
                return what, azimuth_of(view), view.lobe_angle
            case "slice":
                return what, azimuth_of(view)
            case "albedo":
                return (what,)
            case "surface":
                return what, view.lobe_pixel, view.lobe_log, view.selected and view.selected.object

    def _make(self, part: Part, view: ViewState) -> None:
        board = self._board
        match part:
            case "sphere":
                self._step_sphere(view)
            case "lobe":
                board.lobe = brdf_views.lobe(self._stack, view.lobe_angle, azimuth_of(view))
            case "slice":
                self._slice = self._slice or brdf_views.Slice(self._passes, self._memory)
                self._slice.draw(self._stack, azimuth_of(view))
                board.slice, board.slice_value = self._picture(self._slice.texture), self._slice.value
            case "albedo":
                self._step_albedo(view)
            case "surface":
                point = None if view.lobe_pixel is None else self._surface_at(*view.lobe_pixel)
                board.surface = None if point is None else surface_lobe(self._stack, point, view.lobe_log)

    def _step_sphere(self, view: ViewState) -> None:
        """Draw some rows of the sphere. A step under way is finished, even with other curves, so that one is shown."""
        side, question = self._board.sphere_side, self._inputs_of("sphere", self._stack.layers, view)
        if self._sphere is None or self._sphere.side != side:
            self._retired = self._sphere  # this frame's panels show it
            self._sphere, self._begun_for["sphere"] = LitSphere(self._passes, self._memory, side), question
            self._board.sphere = None
        elif self._begun_for["sphere"] != question and not self._sphere.is_within_step:
            self._sphere.restart()
            self._begun_for["sphere"] = question
        started, rows = time.perf_counter(), min(self._rows, self._sphere.rows_left)
        self._sphere.step(self._stack, self._tone_mapping, rows)
        self._rows = max(self._rows_in_time(rows, started), LEAST_ROWS)
        if self._sphere.steps:
            self._board.sphere = self._picture(self._sphere.texture)

    def _step_albedo(self, view: ViewState) -> None:
        """Draw some rows of the albedos' sums; a sum under way is finished first, even with other curves."""
        if self._albedo is None:
            self._albedo = brdf_views.AlbedoShares(self._memory)
        if not self._albedo.is_begun:
            self._begun_for["albedo"] = self._inputs_of("albedo", self._stack.layers, view)
        started, rows = time.perf_counter(), min(self._albedo_rows, brdf_views.N_ROWS)
        found = self._albedo.step(self._stack, rows)
        self._albedo_rows = max(self._rows_in_time(rows, started), LEAST_ALBEDO_ROWS)
        if found is not None:
            self._board.albedo = found

    def _pace(self, layers: Layers) -> None:
        """Start with few rows: with other models, or a table, a row may take several times as long."""
        what = tuple(layer.model for layer in layers), self._board.curves_alone
        if what != self._paced_for:
            self._paced_for, self._rows, self._albedo_rows = what, LEAST_ROWS, LEAST_ALBEDO_ROWS

    def _rows_in_time(self, rows: int, started: float) -> int:
        """How many rows to draw the next time, where so many took the time since then."""
        self._context.finish()
        ratio = ROWS_SECONDS / max(time.perf_counter() - started, 1e-6)
        return math.ceil(rows * min(max(ratio, 0.25), 1.5))


def no_surface(column: int, row: int) -> SurfacePoint | None:
    """A substitute before there is a picture."""
    return None


def shown_layers(document: Document, view: ViewState, counts: Sequence[NodeCount] = ()) -> Layers:
    """The selected layer, a Fresnel term and its layer together, or all visible layers of the object; those whose
    parameters vary over the surface at one node, the one whose curve has the handles. counts: the document's nodes.

    None where nothing is selected.
    """
    selected = layer_shown(document, view.selected)
    if selected is None:
        return ()
    layers = tuple(
        _at_node(document, layer_key(selected.object, i), view, counts)
        for i in range(len(document.object(selected.object).layers))
    )
    if view.brdf_whole:
        return tuple(layer for layer in layers if layer.visible)
    lead = layers[linked_indices(layers, selected.layer)[0]] if layers[selected.layer].rises else None
    chosen = lead or layers[selected.layer]
    return (chosen, *(layer for layer in layers if layer.rises and layer.follows == chosen.name))


def _at_node(document: Document, key: str, view: ViewState, counts: Sequence[NodeCount]) -> Layer:
    layer = document.layer(key)
    if not layer.parameter_maps:
        return layer
    names = [factor.name for factor in all_factors(layer.model)]
    chosen = None if view.selected is None else view.selected.factor
    nodes = layers_at_nodes(document, key, counts, chosen if chosen in names else names[0])
    return nodes[picked_node(nodes, view.node)].replace(parameter_maps=())


def azimuth_of(view: ViewState) -> float:
    """The plane of lobe and slice, radians from the tangent."""
    return 0.5 * math.pi if view.brdf_across else 0.0


# The time that a piece of an upload may take.
UPLOAD_SECONDS = 0.004


class TableFeed:
    """The tables of one window; `tables` are for stacks of layers."""

    def __init__(self, context: moderngl.Context) -> None:
        self.tables = MeasuredTables(TextureMemory(context))
        self._no_room: dict[int, str] = {}
        self._in_use: tuple[int, ...] = ()

    def missing(self, measurements: Iterable[Measurement]) -> list[Measurement]:
        """Those whose tables are not on the GPU."""
        return [each for each in measurements if each.number not in self.tables]

    def problem_of(self, editor: Editor, measurements: Iterable[Measurement]) -> str:
        """Why a table that is missing will not come, in one line; empty where it may."""
        reasons = (self._no_room.get(m.number) or editor.tables.refusal(m) for m in self.missing(measurements))
        return next(filter(None, reasons), "")

    def want(self, editor: Editor, measurements: Sequence[Measurement]) -> None:
        """Request what is on screen, which stays on the GPU as long as it is."""
        self._in_use = tuple(each.number for each in measurements)
        self._request_missing(editor, measurements)

    def _request_missing(self, editor: Editor, measurements: Iterable[Measurement]) -> bool:
        """Request the first missing table from the worker, unless one is under way; returns whether one may come."""
        coming = [each for each in self.missing(measurements) if not self.problem_of(editor, [each])]
        if coming and not self.tables.is_uploading:
            editor.tables.request_table(coming[0])
        return bool(coming)

    def complete(self, editor: Editor, layers: Layers) -> Layers | None:
        """The layers with what their files contain, once their tables are here or known not to come; None until
        then."""
        measured = [found for layer in layers if (found := measurement_in(layer)) is not None]
        known = [editor.tables.resolve_measurement(each) for each in measured]
        if self._request_missing(editor, known):
            return None
        return with_measurements(layers, {each.file: each for each in known}) if known else layers

    def advance(self, editor: Editor) -> bool:
        """Make room for a table that has come, or upload a piece of it. Returns whether there is something new to
        draw."""
        if not self.tables.is_uploading:
            come = editor.tables.take()
            return come is not None and not self._begin(*come)
        is_whole = self.tables.step(UPLOAD_SECONDS)
        if is_whole:
            self.tables.forget_but(self._in_use)
        return is_whole

    def release(self) -> None:
        """Free all textures."""
        self.tables.release()

    def _begin(self, number: int, samples: NDArray[np.float32]) -> bool:
        """Make room for a table; returns whether there is any."""
        try:
            self.tables.begin(number, samples)
        except GraphicsError as error:
            self._no_room[number] = str(error)
        return number not in self._no_room
