"""How much the picture changes where Placement takes over from Orbit or Deform: `python -m benchmarks.hand_over`.

Both pictures are of one camera and pose, at rest, as the window shows them in 8 bits. The change is the mean absolute
difference, in 1/255; pixels of objects whose surface only Deform draws are left out, because Placement does not show
them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.commands import SetTime
from app.measure.report import table
from app.measure.subject import at_most, open_subject
from app.project.project import Project, open_project
from app.stills.stills import deform_only_objects, prepared_deform, prepared_orbit, render_picture
from app.system.kernel_cache import use_kernel_cache
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.realtime.zonal_harmonics.deform_engine import finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.render.display import display_picture
from engine.scene.primary_hits import trace_primary
from engine.scene.raycaster import RayCaster

SIDE = 192
BENT: Poses = (("teapot", (Deformation("bend", 25.0),)),)


@dataclass(frozen=True)
class Case:
    """A scene in Orbit or in Deform, there at a time of its animations or in a pose; n_bounces: None for as many as
    the scene says."""

    source: str
    mode: str
    time: float = 0.0
    poses: Poses = ()
    n_bounces: int | None = None

    @property
    def series(self) -> BounceSeries | None:
        return None if self.n_bounces is None else BounceSeries(self.n_bounces)

    @property
    def name(self) -> str:
        if self.n_bounces is not None:
            return f"{self.source}, {self.n_bounces} bounce{'s' * (self.n_bounces > 1)}"
        return f"{self.source}, bent" if self.poses else f"{self.source}, {self.time:g} s" if self.time else self.source


CASES = (
    *(Case(name, "orbit", n_bounces=n) for name in ("room", "storeroom") for n in (1, 4)),
    Case("mime", "deform"), Case("mime", "deform", 0.4), Case("bat", "deform", 0.4),
    Case("teatray", "deform", 0.0, BENT),
)  # fmt: skip


@dataclass(frozen=True)
class Change:
    """Means over the picture and over each object, and the worst block of 8 x 8 pixels, in 1/255."""

    case: Case
    mean: float
    worst: float
    objects: dict[str, float]


def measure(case: Case, side: int = SIDE) -> Change:
    """The change of one case in a picture of at most `side` pixels."""
    project = open_project(case.source, at_most(open_subject(case.source).scene.resolution, side))
    drawn, posed = _orbit(project, case) if case.mode == "orbit" else _deform(project, case)
    shown, taken = (
        display_picture(each).astype(float)
        for each in (drawn, render_picture(posed, lambda step: None, series=case.series))
    )
    off = np.abs(shown - taken).mean(axis=2)
    hits = trace_primary(posed.scene, RayCaster(posed.scene.vertices, posed.scene.triangles))
    names = posed.scene.object_names
    left_out = [i for i, name in enumerate(names) if name in deform_only_objects(project) and case.mode == "deform"]
    counts = ~np.isin(hits.object_image, left_out)
    objects = {
        names[i]: float(off[hits.object_image == i].mean())
        for i in np.unique(hits.object_image[counts & (hits.object_image >= 0)])
    }
    return Change(case, float(off[counts].mean()), _worst_block(np.where(counts, off, 0.0)), objects)


def _orbit(project: Project, case: Case) -> tuple[NDArray[np.float32], Project]:
    orbit, scene = prepared_orbit(project, case.series), project.scene
    for _ in range(2):  # once more for the backs that the first picture sees
        for _step in orbit.work():
            pass
        drawn = orbit.draw(scene.description.camera, scene.resolution, "rest")
    return drawn, project


def _deform(project: Project, case: Case) -> tuple[NDArray[np.float32], Project]:
    poses = case.poses or (SetTime(case.time).apply(project.document).poses if case.time else ())
    deform = finish_deform(prepared_deform(project, project.resting, [name for name, _ in poses], case.series))
    scene = project.resting
    drawn = deform.draw(scene.description.camera, scene.resolution, poses, "rest")
    return drawn, replace(project, scene=pose_scene(scene, poses))


def _worst_block(off: NDArray[np.floating], size: int = 8) -> float:
    height, width = (n // size * size for n in off.shape)
    blocks = off[:height, :width].reshape(height // size, size, width // size, size).mean(axis=(1, 3))
    return float(blocks.max(initial=0.0))


def report(cases: Sequence[Case] = CASES, side: int = SIDE) -> str:
    """The table of all cases."""
    lines = []
    for each in (measure(case, side) for case in cases):
        worst = sorted(each.objects.items(), key=lambda item: -item[1])[:3]
        named = ", ".join(f"{name} {off:.1f}" for name, off in worst)
        lines.append([f"{each.case.name} ({each.case.mode})", f"{each.mean:.2f}", f"{each.worst:.1f}", named])
    return table(["", "mean", "worst block", "objects that change most"], lines)


if __name__ == "__main__":
    use_kernel_cache()
    print(report(CASES[int(sys.argv[1]) :] if len(sys.argv) > 1 else CASES))
