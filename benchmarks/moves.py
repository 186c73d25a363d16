"""What a dragged lamp or sun and a moved object cost in Placement until they are seen, and how exact that is.

The worker's own requests are carried out in this process, as the window asks them, and their pictures are uploaded and
shaded. The scene is that of the mix of lights: two balls under a sky and seven lamps, one of which is coated metal.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.document.commands import DeleteObject, DuplicateObject, EditCommand, MoveObject, SetVisible
from app.document.commands.suns import direction_of
from app.document.document import Document
from app.document.scene_state import SceneState
from app.messages.worker_messages import Request, RequestFailed, Response, SetCamera, ViewTraced
from app.modes.placement.placement_messages import (
    FreezeIndirect,
    IndirectFound,
    IndirectFrozen,
    IndirectRelit,
    LayerPicture,
    PrepareRelighting,
    StageDone,
    StageFootprint,
)
from app.worker.schedule import InProcessClient
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.light_mix import scene_text
from benchmarks.relighting import Pictures, ReadyScene, RelightEffort, state_of
from engine.light.suns import Sun
from engine.render.picture_difference import errors
from engine.scene.transform import Transform
from engine.settings import RenderSettings

if TYPE_CHECKING:
    import moderngl

    from engine.scene.picture_frame import PictureFrame

NAMES = ("light_drag_first_ms", "light_drag_exact_s", "move_first_s")
LAMP, OBJECT = "lamp 2", "matt"
SUN_ELEVATION, SUN_IRRADIANCE = 40.0, (2.0, 1.8, 1.5)  # degrees, W/m²
OTHER_EDITS: dict[str, tuple[EditCommand, ...]] = {
    "hidden": (SetVisible(OBJECT, False),),
    "deleted": (DeleteObject(OBJECT),),
    "duplicated": (DuplicateObject(OBJECT, "copy"), MoveObject("copy", (0.2, 0.0, 0.7))),
}
_FACTOR = 0  # of the selected layer


@dataclass(frozen=True)
class MoveEffort:
    """The side of the picture, its lights, bounces, and how often a hand moves each."""

    side: int = 512
    n_final: int = 400
    n_bounces: int = 4
    n_moves: int = 5


def move_figures(effort: MoveEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    report("a dragged lamp and a moved object in Placement")
    try:
        with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
            return _measured(effort, Path(folder))
    except NotMeasured as error:
        return [not_measured(name, str(error)) for name in NAMES]


def _measured(effort: MoveEffort, folder: Path) -> list[Figure]:
    (folder / "scene.toml").write_text(scene_text())
    size = effort.side, effort.side
    ready = _OpenScene(str(folder / "scene.toml"), RelightEffort(size, n_final=effort.n_final), folder, effort)
    how = f"{effort.side} x {effort.side}, two balls under a sky and seven lamps, {effort.n_bounces} bounces"
    ready.rest()
    drags = [ready.drag((0.08 * (k + 1), 0.0, 0.05 * k)) for k in range(effort.n_moves)]
    first, whole = (tuple(getattr(each, name) for each in drags) for name in ("first_s", "whole_s"))
    moves = [ready.edit(MoveObject(OBJECT, (0.06 * (k + 1), 0.0, 0.04 * k))) for k in range(effort.n_moves)]
    lamp = ready.edit(MoveObject(LAMP, (0.3, 0.0, 0.1)))
    others = {name: ready.edit(*commands) for name, commands in OTHER_EDITS.items()}
    ready.rest_in_sun()
    suns = [ready.drag_sun(8.0 * (k + 1)) for k in range(effort.n_moves)]
    return [
        Figure(
            "light_drag_first_ms", tuple(1e3 * each for each in first[1:]),
            f"{how}: from a place of the lamp to its shadowed direct light on screen",
            {
                "the first place": 1e3 * first[0],
                "processor": 1e3 * float(np.median([each.first_cpu for each in drags[1:]])),
                "a sun, the first place": 1e3 * suns[0].first_s,
                "a sun": 1e3 * float(np.median([each.first_s for each in suns[1:]])),
                "a sun, processor": 1e3 * float(np.median([each.first_cpu for each in suns[1:]])),
            },
        ),
        Figure(
            "light_drag_exact_s", whole[1:], f"{how}: the same, with all bounces",
            {
                "the first place": whole[0],
                "processor": float(np.median([each.whole_cpu for each in drags[1:]])),
                "a sun, the first place": suns[0].whole_s,
                "a sun": float(np.median([each.whole_s for each in suns[1:]])),
                "a sun, processor": float(np.median([each.whole_cpu for each in suns[1:]])),
            },
        ),
        Figure(
            "move_first_s", tuple(each.first_s for each in moves),
            f"{how}: from the pose of a ball to the first whole picture of it on screen",
            {
                "tracing": float(np.median([each.traced_s for each in moves])),
                "processor": float(np.median([each.first_cpu for each in moves])),
                "a lamp": lamp.first_s, "error": max(each.error for each in moves), "error of a lamp": lamp.error,
                **{name: each.first_s for name, each in others.items()},
                **{f"{name}, processor": each.first_cpu for name, each in others.items()},
            },
        ),
    ]  # fmt: skip


@dataclass(frozen=True)
class _Drag:
    """Seconds, and processor seconds, until direct light was on screen, and until all of it was."""

    first_s: float
    whole_s: float
    first_cpu: float
    whole_cpu: float


@dataclass(frozen=True)
class _Edit:
    """Seconds until the view was traced, and until its first picture was on screen; its processor seconds, and its
    relRMSE in direct light against the transport of a fresh start, 1 where it has fewer points."""

    traced_s: float
    first_s: float
    first_cpu: float
    error: float


class _OpenScene(ReadyScene):
    """The scene with its exact picture, and a renderer that shows it."""

    def __init__(self, source: str, effort: RelightEffort, cache: Path, settings: MoveEffort) -> None:
        super().__init__(source, effort, cache)
        self._size, self._settings = effort.resolution, settings
        self._screen = _Screen()

    def request(self, scene: SceneState, is_drag: bool = False) -> Request:
        of_direct = self.transport(scene, self._settings.n_final)
        settings = RenderSettings(self._settings.n_final, n_bounces=self._settings.n_bounces)
        return replace(of_direct, settings=settings, is_drag=is_drag)

    @property
    def freezing(self) -> FreezeIndirect:
        return FreezeIndirect(self.scene, self.scene.layers[0].key, _FACTOR)

    def look(self, document: Document) -> SetCamera:
        return SetCamera(1, None, self._size, document.poses, composition=document.composition)

    def rest(self) -> Pictures:
        """Find the exact picture of the scene as it is, and show it; returns what each layer sends."""
        found = Pictures()
        for answer in self.answers(self.look(self.document)):
            if isinstance(answer, ViewTraced):
                self._show(answer)
        for answer in self.answers(self.request(self.scene), self.freezing):
            match answer:
                case LayerPicture(stage="preview" | "final"):
                    found[answer.key] = np.array(answer.radiance)
                    self._screen.take(answer.key, answer.radiance)
                case IndirectFound():
                    self._screen.footprint(answer.rows, answer.weights)
        self._screen.draw()
        return found

    def _show(self, answer: ViewTraced) -> None:
        scene = self._tasks.context.open_placement.scene
        self._screen.show(answer.frame, {each.key: scene.object_index(each.object) for each in self.scene.layers})

    def answers(self, *requests: Request) -> Iterator[Response]:
        """The answers, as they come."""
        client = InProcessClient(self._tasks)
        for request in requests:
            client.send(request)
        while client.wait(0.0):
            for answer in client.poll(0.0):
                if isinstance(answer, RequestFailed):
                    raise NotMeasured(answer.line)
                yield answer

    def drag(self, by: tuple[float, float, float]) -> _Drag:
        """A lamp as a hand has it."""
        return self._drag_light(replace(self.scene, lamps=((LAMP, (Transform(by),)),)))

    def drag_sun(self, azimuth: float) -> _Drag:
        """The sun as a hand has it."""
        return self._drag_light(self._with_sun(azimuth))

    def rest_in_sun(self) -> None:
        """Find the exact picture with a sun as well, and prepare it for another sky, as the window does at rest."""
        self.scene = self._with_sun(0.0)
        self.rest()
        self.ask(PrepareRelighting(self.scene))

    def _with_sun(self, azimuth: float) -> SceneState:
        sun = Sun(direction_of(azimuth, SUN_ELEVATION), SUN_IRRADIANCE, name="sun")
        return replace(self.scene, light=replace(self.scene.light, new_suns=(sun,)))

    def _drag_light(self, scene: SceneState) -> _Drag:
        begun, cpu = time.perf_counter(), time.process_time()
        first_s, first_cpu, n_direct = 0.0, 0.0, 0
        for answer in self.answers(self.request(scene, is_drag=True)):
            match answer:
                case LayerPicture():
                    self._screen.take(answer.key, answer.radiance)
                    n_direct += 1
                    if n_direct == len(scene.layers):  # direct light is whole; that between surfaces comes later
                        self._screen.draw()
                        first_s, first_cpu = time.perf_counter() - begun, time.process_time() - cpu
                case IndirectRelit():
                    for key, light in answer.now.items():
                        self._screen.take_indirect(key, light)
                    self._screen.draw()
        return _Drag(first_s, time.perf_counter() - begun, first_cpu, time.process_time() - cpu)

    def edit(self, *commands: EditCommand) -> _Edit:
        """Add, delete, hide or move an object, and measure until the first whole picture; then find the exact one, and
        undo it."""
        before = self.document, self.scene
        for command in commands:
            self.document = command.apply(self.document)
        self.scene = state_of(self.document)
        found = Pictures()
        begun, cpu, traced_s = time.perf_counter(), time.process_time(), 0.0
        for answer in self.answers(self.look(self.document)):
            if isinstance(answer, ViewTraced):
                traced_s = time.perf_counter() - begun
                self._show(answer)
        for answer in self.answers(self.request(self.scene), self.freezing):
            match answer:
                case StageFootprint():
                    self._screen.stage_footprint(answer.rows, answer.weights)
                case LayerPicture():
                    found[answer.key] = np.array(answer.radiance)
                    self._screen.take(answer.key, answer.radiance)
                case IndirectFound():
                    self._screen.footprint(answer.rows, answer.weights)
                case IndirectFrozen():
                    for number, powers in answer.light.reflected.items():
                        self._screen.take_indirect(answer.keys[number], np.ascontiguousarray(powers.sum(axis=1).T))
                case StageDone():
                    self._screen.draw()
                    break
        first_s, first_cpu = time.perf_counter() - begun, time.process_time() - cpu
        exact = self.rest()
        is_whole = all(key in found and found[key].shape == exact[key].shape for key in exact)
        both = [np.concatenate([each[key] for key in sorted(exact)]) for each in (found, exact)] if is_whole else []
        self.document, self.scene = before
        self.rest()
        return _Edit(traced_s, first_s, first_cpu, errors(*both).rmse if both else 1.0)


class _Screen:
    """A renderer of pictures without a window. Raises NotMeasured where there is no OpenGL."""

    def __init__(self) -> None:
        from ui.gl.context import GraphicsError, create_headless_context
        from ui.modes.placement.gl.renderer import PlacementRenderer

        try:
            self._context: moderngl.Context = create_headless_context()
        except GraphicsError as error:
            raise NotMeasured(str(error)) from None
        self._renderer, self._is_ready = PlacementRenderer(self._context), False
        self._n_points: dict[str, int] = {}
        self._coarse: tuple[np.ndarray, np.ndarray] | None = None

    def show(self, frame: PictureFrame, objects: dict[str, int]) -> None:
        self._renderer.set_frame(frame)
        for key, index in objects.items():
            begin, end = frame.object_ranges[index]
            self._n_points[key] = int(end - begin)
            self._renderer.set_layer(key, index, self._n_points[key])
        self._is_ready, self._coarse = True, None

    def footprint(self, rows: np.ndarray, weights: np.ndarray) -> None:
        self._renderer.set_indirect_footprint(rows, weights)

    def stage_footprint(self, rows: np.ndarray, weights: np.ndarray) -> None:
        """Note which samples of a coarse stage stand for each point."""
        self._coarse = rows, weights

    def take(self, key: str, radiance: np.ndarray) -> None:
        if self._is_ready:
            is_whole = len(radiance) == self._n_points[key]
            self._renderer.set_footprint(*((None, None) if is_whole or self._coarse is None else self._coarse))
            self._renderer.set_layer_radiance(key, radiance)

    def take_indirect(self, key: str, light: np.ndarray) -> None:
        if self._is_ready:
            self._renderer.set_layer_indirect(key, light)

    def draw(self) -> None:
        from ui.gl.display import DisplayView

        if self._is_ready:
            self._renderer.composite(DisplayView())
            self._context.finish()
