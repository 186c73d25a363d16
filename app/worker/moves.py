"""Objects and lamps of the open view that move: what stays of its pictures, and of those of the view before."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from app.document.scene_state import LayerState, SceneState
from app.worker.dragged_lamps import DraggedLamps
from app.worker.layer_data import RELIT, LayerData, LightingState
from app.worker.light_pictures import LightPictures
from app.worker.moved_pictures import MovedPictures, TracedScene, whole_pictures
from app.worker.tasks import WorkerContext
from engine.core.generators import map_steps
from engine.precompute.direct.bandstore import FixedPicture
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.scene_loader import Scene

if TYPE_CHECKING:
    from app.worker.indirect_tasks import IndirectTasks

Layers = Mapping[str, LayerData]
# A layer's picture, or None after another step.
Pictures = Iterator[LayerData | None]


class Moves:
    """The moves of the open view. moved: from the view before, or from that where something was drawn last, until
    pictures of this one are made of it; dragged: the lamps that a hand has."""

    def __init__(self, context: WorkerContext) -> None:
        self._context = context
        self._traced: TracedScene | None = None
        self._first: dict[str, LayerData] = {}
        self.moved: MovedPictures | None = None
        self._light: IndirectTasks | None = None  # of the view that `moved` begins with
        self.dragged: DraggedLamps | None = None

    def view_traced(
        self, layers: Layers, light: IndirectTasks | None
    ) -> tuple[MovedPictures | None, IndirectTasks | None]:
        """Note that another view is open; returns what was moved, and the light between surfaces of the view that this
        begins with. layers, light: of the view before."""
        placement, before = self._context.open_placement, self._traced
        pictures = self._resting(layers)
        if self.moved is not None and not pictures:  # moved again before anything was drawn
            before, pictures, light = self.moved.before, self.moved.layers, self._light
        self.moved = None if before is None else MovedPictures.between(before, placement, pictures)
        self._light = None if self.moved is None else light
        self._traced = TracedScene(placement.scene, placement.caster, placement.hits)
        self._first, self.dragged = {}, None
        return self.moved, self._light

    def _resting(self, layers: Layers) -> dict[str, LayerData]:
        """The pictures of the open view, at every point."""
        return self._first | whole_pictures(layers)

    def has_first(self, works: Sequence[LayerState], lit_by: LightingState) -> bool:
        """Whether the first pictures of all layers in this light were made of the view before."""
        known = [self._first.get(work.key) for work in works]
        pairs = zip(known, works, strict=True)
        return bool(works) and all(each is not None and each.is_picture_of(work, lit_by) for each, work in pairs)

    def first_pictures(self, works: Sequence[LayerState], lit_by: LightingState, sky: SkyState) -> Pictures:
        """Pictures of layers, all or none, made of those of the view before."""
        moved = self.moved
        if moved is None or not works or not all(moved.takes(work, lit_by) for work in works):
            return
        yield from map_steps(moved.find_light(sky), lambda step: None)
        for work in works:
            picture = yield from map_steps(moved.picture(work), lambda step: None)
            self._first[work.key] = LayerData(work, lit_by, RELIT.name, FixedPicture(picture), 1.0)
            yield self._first[work.key]
        self.forget_before()

    def forget_before(self) -> None:
        """Forget the view that this one began with: it has pictures of its own."""
        self.moved = self._light = None

    def dragged_pictures(
        self, works: Sequence[LayerState], scene: SceneState, moved: Scene, layers: Layers, lights: LightPictures
    ) -> Pictures:
        """Pictures of layers, all or none, under lamps where a scene has them. They are not held: the next ones begin
        with the pictures at rest as well."""
        bases = self._resting(layers)
        if self.dragged is None or not self.dragged.serves(scene.lamps):
            self.dragged = DraggedLamps(self._context.open_placement, [name for name, _ in scene.lamps])
        if not all(self.dragged.takes(work, bases.get(work.key), scene) for work in works):
            return
        for work in works:
            base = bases[work.key]
            picture = yield from map_steps(self.dragged.picture(work, base, moved, lights), lambda step: None)
            yield LayerData(work, base.lit_by, RELIT.name, FixedPicture(picture), 1.0)

    def scene_with(self, scene: SceneState) -> Scene:
        """The open scene with its lamps where a hand has them; others are at rest."""
        return pose_scene(self._context.rest_scene, scene.lamps)
