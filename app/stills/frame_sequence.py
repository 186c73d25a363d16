"""Many pictures of one scene: all around it, or all through its animation.

The camera orbits its target once, in equal steps from where the scene has it; the animation advances in equal steps
from its start, so that the first frame follows the last. Frames do not depend on one another: each is the same whatever
others are drawn before it, and wherever it is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from app.document.commands import SetTime
from app.document.scene_state import moved_objects
from app.document.timeline import timeline
from app.document.view_state import ViewState
from app.project.project import Project
from app.stills.shadow_catcher import caught_objects, without_others
from app.stills.stills import (
    Mode,
    Still,
    StillProgress,
    deform_only_objects,
    draw_still,
    estimate_picture_error,
    finished_picture,
    prepared_deform,
    prepared_orbit,
    still_settings,
    with_caught_shadows,
)
from engine.core.errors import InsituError
from engine.precompute.direct.pipeline import Quality
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.realtime.core.picture_parts import parts_of
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.camera_moves import orbit_camera
from engine.scene.cutouts import scene_caster
from engine.scene.description import Camera
from engine.scene.scene_loader import Scene

Report = Callable[[StillProgress], None]
Picture = NDArray[np.float32]


@dataclass(frozen=True)
class Frames:
    """A number of frames, and how they are drawn. animated: of the scene's animation, else all around it; settings:
    those that differ from a still's, by name; series: None for as many bounces as a still of the scene has."""

    count: int
    animated: bool = False
    mode: Mode = "placement"
    settings: tuple[tuple[str, Any], ...] = ()
    series: BounceSeries | None = None


class Drawer(Protocol):
    """Draws frames by their number. ready_at: the fraction of the work that preparation is."""

    ready_at: float

    def prepare(self, report: Report) -> None:
        """Do what is done once for all frames."""

    def draw(self, i: int) -> Picture:
        """Linear radiance (H, W, 3) of frame i, with alpha (H, W, 4) over a transparent background."""


Draw = Callable[[Project, Frames, Sequence[int], Report], Iterator[tuple[int, Picture]]]


def draw_here(
    project: Project, frames: Frames, numbers: Sequence[int], report: Report
) -> Iterator[tuple[int, Picture]]:
    """The frames of these numbers, one after the other. Raises InsituError."""
    if not numbers:
        return
    drawer = drawer_of(project, frames)
    drawer.prepare(lambda step: report(replace(step, fraction=drawer.ready_at * step.fraction)))
    for n, i in enumerate(numbers):
        fraction = drawer.ready_at + (1.0 - drawer.ready_at) * n / len(numbers)
        report(StillProgress(fraction, f"frame {n + 1} of {len(numbers)}"))
        yield i, drawer.draw(i)


def drawer_of(project: Project, frames: Frames) -> Drawer:
    """The drawer of these frames. Raises InsituError where the scene has no animation."""
    poses = poses_of(project, frames.count) if frames.animated else []
    alone = without_others(project)
    if alone is None:
        return _FinishedFrames(project, _drawer(project, frames, poses))
    names = set(alone.object_names)
    own = [tuple(each for each in pose if each[0] in names) for pose in poses]
    return _FinishedFrames(project, _drawer(project, frames, poses), _drawer(alone, frames, own))


def _drawer(project: Project, frames: Frames, poses: Sequence[Poses]) -> _RawDrawer:
    if not frames.animated:
        seen = [project.scene.from_camera(camera) for camera in cameras(own_camera(project.scene), frames.count)]
        return (
            _OrbitFrames(project, frames, seen) if frames.mode == "orbit" else _PlacementFrames(project, frames, seen)
        )
    if frames.mode == "deform":
        return _DeformFrames(project, frames, poses)
    return _PlacementFrames(project, frames, [_in_poses(project, each) for each in poses])


def estimate_frame_error(project: Project, frames: Frames, i: int, picture: Picture) -> str:
    """The error of frame i of an animation, as one line; "" where it cannot be estimated."""
    scene = _in_poses(project, poses_of(project, frames.count)[i])
    if deform_only_objects(project) or project.document.shadow_catchers:
        return ""
    n_bounces = None if frames.series is None else frames.series.n_bounces
    estimate = estimate_picture_error(replace(project, scene=scene), picture, n_bounces)
    return "" if estimate is None else estimate.text


def own_camera(scene: Scene) -> Camera:
    """The camera of the scene, without what else its file sets of the view."""
    described = scene.description.camera
    return Camera(**{name: getattr(described, name) for name in Camera.model_fields})


def cameras(camera: Camera, count: int) -> list[Camera]:
    """The cameras once around the target, starting with the camera itself."""
    return [camera, *(orbit_camera(camera, 2.0 * math.pi * i / count, 0.0) for i in range(1, count))]


def poses_of(project: Project, count: int) -> list[Poses]:
    """The poses through the animation, from its start. Raises InsituError where there is none."""
    line = timeline(project.document, ViewState())
    if line is None:
        raise InsituError("--frames: the scene has no animation")
    return [SetTime(line.duration * i / count).apply(project.document).poses for i in range(count)]


def _in_poses(project: Project, poses: Poses) -> Scene:
    bumped = pose_scene(project.resting, poses).with_bumps(dict(project.document.new_bumps))
    return bumped.from_camera(None, project.scene.resolution)


def _still_of(picture: Picture) -> Still:
    """The still of a picture with the part of shadow catchers, where there are some."""
    whole, part = parts_of(picture)
    return Still(whole, catchers=part)


class _RawDrawer(Protocol):
    """Draws frames before the intensity of the light, their background and shadow catchers."""

    ready_at: float

    def prepare(self, report: Report) -> None:
        """Do what is done once for all frames."""

    def draw(self, i: int, quality: Quality | None = None) -> Still:
        """Frame i; quality: see `still_steps`."""

    def scene(self, i: int) -> Scene:
        """The scene of frame i, as it is seen."""


class _FinishedFrames:
    """Finishes frames: with the shadows on catchers, where those alone are drawn as well."""

    def __init__(self, project: Project, whole: _RawDrawer, rest: _RawDrawer | None = None) -> None:
        self._project, self._whole, self._rest = project, whole, rest
        self.ready_at = whole.ready_at

    def prepare(self, report: Report) -> None:
        self._whole.prepare(report)
        if self._rest is not None:
            self._rest.prepare(lambda step: None)

    def draw(self, i: int) -> Picture:
        still = self._whole.draw(i)
        picture = still.picture
        if self._rest is not None:
            rest, seen = self._rest.draw(i, still.quality), replace(self._project, scene=self._whole.scene(i))
            picture = with_caught_shadows(seen, picture, still.catchers, rest.catchers)
        return finished_picture(self._project.document, picture)


class _PlacementFrames:
    """Draws each frame as a still of its own; where only the camera moves, with the same rays."""

    ready_at = 0.0

    def __init__(self, project: Project, frames: Frames, seen: Sequence[Scene]) -> None:
        self._project, self._frames, self._seen = project, frames, seen
        scene = project.scene
        self._caster = None if frames.animated else scene_caster(scene)

    def prepare(self, report: Report) -> None:
        """Does nothing: frames share no work."""

    def scene(self, i: int) -> Scene:
        return self._seen[i]

    def draw(self, i: int, quality: Quality | None = None) -> Still:
        own, frames = replace(self._project, scene=self._seen[i]), self._frames
        how = dict(frames.settings, series=frames.series, caster=self._caster, quality=quality)
        return draw_still(own, lambda step: None, **how)


class _OrbitFrames:
    """Precomputes all once; what only some cameras see, when one does."""

    ready_at = 0.3

    def __init__(self, project: Project, frames: Frames, seen: Sequence[Scene]) -> None:
        settings = still_settings(project, "orbit", dict(frames.settings))
        self._orbit, self._seen = prepared_orbit(project, frames.series, settings), seen
        self._document, self._apart = project.document, caught_objects(project)

    def prepare(self, report: Report) -> None:
        for step in self._orbit.work():
            report(step)

    def scene(self, i: int) -> Scene:
        return self._seen[i]

    def draw(self, i: int, quality: Quality | None = None) -> Still:
        camera, resolution = self._seen[i].description.camera, self._seen[i].resolution
        how: dict[str, Any] = {"transparent": self._document.hides_environment, "apart": self._apart}
        picture = self._orbit.draw(camera, resolution, "still", **how)
        if not self._orbit.is_done:
            for _ in self._orbit.work():
                pass
            picture = self._orbit.draw(camera, resolution, "still", **how)
        return _still_of(picture)


class _DeformFrames:
    """Precomputes all once; frames differ only in their poses. Objects that deform cast on all others the coarse
    shadows that they have while moving, see `engine.realtime.zonal_harmonics.shading`, whose error
    `estimate_frame_error` estimates; a still in one pose has transfer of its own for that, which takes as long as the
    precomputation."""

    ready_at = 0.95

    def __init__(self, project: Project, frames: Frames, poses: Sequence[Poses]) -> None:
        self._deform = prepared_deform(project, project.resting, [name for name, _ in poses[0]], frames.series)
        self._deform.set_moved(*moved_objects(project.document))
        self._scene, self._poses = project.scene, poses
        self._document, self._project = project.document, project

    def prepare(self, report: Report) -> None:
        for step in self._deform.work():
            report(step)

    def scene(self, i: int) -> Scene:
        return _in_poses(self._project, self._poses[i])

    def draw(self, i: int, quality: Quality | None = None) -> Still:
        camera, resolution = self._scene.description.camera, self._scene.resolution
        how: dict[str, Any] = {"transparent": self._document.hides_environment, "apart": caught_objects(self._project)}
        return _still_of(self._deform.draw(camera, resolution, self._poses[i], "rest", **how))
