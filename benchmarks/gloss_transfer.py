"""Gloss on bodies that bend: rows of transfer [Sloan05, eq. 14-16] beside one lobe, by the order of the harmonics and
by the number of rows.

`python -m benchmarks.gloss_transfer [FOLDER]` writes gloss_transfer.csv and gloss_rows.png, and prints the table. The
reference is a sum of the reflection itself over all 20,480 triangles of the sky that a point of the posed body sees;
the error is the relRMSE over points that the scene's camera sees. Transfer is of the body at rest, and light comes from
the sky alone, once.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray

from app.document.commands import SetTime
from app.measure.report import table
from app.project.project import Project, open_project
from app.system.kernel_cache import use_kernel_cache
from engine.core.generators import run_to_end
from engine.light.environment import triangle_integrals
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.realtime.zonal_harmonics.bending_points import BendingPoints, PosedPoints, bending_points
from engine.realtime.zonal_harmonics.gloss_pilot import (
    LOBE,
    PilotResult,
    black_share,
    by_rows,
    lobe_radiance,
    relative_error,
    some_of,
    traced_gloss,
)
from engine.realtime.zonal_harmonics.gloss_rows import N_ROW_LOBES, gloss_basis, simulate_gloss_rows
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.realtime.zonal_harmonics.shading import band_light, lobes
from engine.realtime.zonal_harmonics.transfer import TransferPoints, simulate_shadows
from engine.realtime.zonal_harmonics.zonal import fit
from engine.scene.raycaster import RayCaster, surface_points
from engine.sphere.harmonics import project

matplotlib.use("Agg")

Float64Array = NDArray[np.float64]

ORDERS, ROWS = (4, 6, 8), (1, 3, 6, 9, 12, 16)
BENT = (Deformation("bend", 50.0),)
FLAP_TIME = 0.4  # seconds
LIGHT_LEVEL = 5
GRAZING = 0.05
COPPER = {"eta": (0.201, 0.9237, 1.1022), "k": (3.9133, 2.453, 2.1421)}
HEADER = ("body", "order", "rows", "error", "black", "bytes a point")


@dataclass(frozen=True)
class GlossEffort:
    """Points of each body, rays of each point's transfer, orders and numbers of rows."""

    n_points: int = 300
    n_rays: int = 1000
    orders: tuple[int, ...] = ORDERS
    rows: tuple[int, ...] = ROWS


@dataclass(frozen=True)
class Body:
    """An object of a scene in a pose, of one glossy layer."""

    scene: str
    name: str
    layer: Layer
    poses: Poses = ()
    time: float | None = None


def _conductor(alpha: float, **more: object) -> Layer:
    return make_layer(MODELS["rough_conductor"], {"alpha": alpha, **more})


HEAD = (("head", BENT),)
BODIES: Mapping[str, Body] = {
    "idol, polished (0.45)": Body("idol", "head", _conductor(0.45, eta=(1.5, 1.5, 1.5), k=(0.0, 0.0, 0.0)), HEAD),
    "idol of dull copper (0.3)": Body("idol", "head", _conductor(0.3, **COPPER), HEAD),
    "idol of copper (0.18)": Body("idol", "head", _conductor(0.18, **COPPER), HEAD),
    "bat of leather (0.4)": Body("bat", "fur", _conductor(0.4, eta=(1.5, 1.5, 1.5), k=(0.0, 0.0, 0.0)), time=FLAP_TIME),
}


@dataclass(frozen=True)
class GlossRow:
    """One line of the table: a body, the order, and what there is of one lobe or of rows; n_bytes: of a point."""

    body: str
    order: int
    found: PilotResult
    n_bytes: int

    @property
    def cells(self) -> tuple[object, ...]:
        rows = self.found.n_rows or "lobe"
        return self.body, self.order, rows, f"{self.found.error:.3f}", f"{self.found.black:.3f}", self.n_bytes


def measure(bodies: Mapping[str, Body] = BODIES, effort: GlossEffort | None = None) -> Iterator[GlossRow]:
    """The lines of all bodies."""
    effort = effort or GlossEffort()
    for name, body in bodies.items():
        yield from PosedBody(body, effort).lines(name, effort)


class PosedBody:
    """Points of a body that the scene's camera sees: their transfer at rest, and their axes and light in the pose."""

    def __init__(self, body: Body, effort: GlossEffort) -> None:
        opened = open_project(body.scene)
        self._layer, self._n_rays = body.layer, effort.n_rays
        scene = opened.resting
        points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 0)
        i = scene.object_index(body.name)
        mesh, self._caster = points.mesh(i, (i,)), points.caster((i,))
        posed, caster = _in_pose(opened, points, i, body)
        camera = np.subtract(scene.description.camera.position, scene.origin)
        which, self._wo = _seen(posed, caster, camera, effort.n_points)
        self._mesh, self._posed = some_of(mesh, which), some_of(posed, which)
        sky = opened.sky
        assert sky.environment is not None
        self._powers = triangle_integrals(sky.environment, sky.rotation, LIGHT_LEVEL) * sky.scale
        self._truth = run_to_end(traced_gloss(self._posed, caster, self._layer, self._powers, self._wo))

    def lines(self, name: str, effort: GlossEffort) -> Iterator[GlossRow]:
        """One lobe, and by each number of rows, of each order."""
        for n in effort.orders:
            light = band_light(project(self._powers, n))
            diffuse = lobes(run_to_end(fit(run_to_end(simulate_shadows(self._mesh, self._caster, n, self._n_rays)), 4)))
            sent = lobe_radiance(self._layer, diffuse, self._posed.frames, light, self._wo)
            yield GlossRow(name, n, self._result(LOBE, sent), 0)
            basis = gloss_basis(self._layer, n, min(max(effort.rows), n * n))
            vectors = run_to_end(simulate_gloss_rows(self._mesh, self._caster, basis, self._n_rays))
            fitted = lobes(run_to_end(fit(vectors.reshape(-1, n * n), N_ROW_LOBES, 0)))
            for k in effort.rows:
                if k <= basis.n_rows:
                    sent = by_rows(self._posed.frames, basis, fitted, k, light, self._wo)
                    yield GlossRow(name, n, self._result(k, sent), 4 * k * (4 + N_ROW_LOBES * (3 + n)))

    def _result(self, n_rows: int, sent: NDArray[np.float32]) -> PilotResult:
        return PilotResult(n_rows, relative_error(sent, self._truth), black_share(sent, self._truth))


def _in_pose(opened: Project, points: BendingPoints, i: int, body: Body) -> tuple[TransferPoints, RayCaster]:
    """The body's points in its pose, and what casts rays against itself there."""
    poses = body.poses if body.time is None else SetTime(body.time).apply(opened.document).poses
    places, frames = PosedPoints(opened.resting, points).at(poses)
    own, mine = points.surface.corners[points.surface.i_object == i], points.points_of(i)
    caster, axes = RayCaster(places, own), frames[mine].astype(np.float64)
    return TransferPoints(surface_points(caster, places[mine], axes[:, 2]), axes, own), caster


def _seen(
    posed: TransferPoints, caster: RayCaster, camera: Float64Array, n_points: int
) -> tuple[NDArray[np.integer], Float64Array]:
    """Some points that a camera sees, and the directions to it (P, 3)."""
    wo = camera - posed.points.position.astype(np.float64)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    faces = np.einsum("pi,pi->p", wo, posed.frames[:, 2]) > GRAZING
    seen = np.flatnonzero(faces & ~caster.occluded(posed.points.offset_position, wo.astype(np.float32)))
    which = np.sort(np.random.default_rng(1).choice(seen, min(n_points, len(seen)), replace=False))
    return which, wo[which]


def plot(file: Path, lines: Sequence[GlossRow]) -> None:
    """Error by the number of rows, one small plot a body; dashed: the lobe of that order."""
    bodies = list(dict.fromkeys(each.body for each in lines))
    figure, all_axes = plt.subplots(1, len(bodies), figsize=(3.2 * len(bodies), 3.0), layout="constrained")
    for axes, body in zip(np.atleast_1d(all_axes), bodies, strict=True):
        for k, n in enumerate(sorted({each.order for each in lines})):
            mine = [each.found for each in lines if (each.body, each.order) == (body, n)]
            lobe, rows = mine[0], mine[1:]
            axes.plot(
                [each.n_rows for each in rows], [each.error for each in rows], "o-", color=f"C{k}", label=f"n = {n}"
            )
            axes.axhline(lobe.error, color=f"C{k}", linestyle="--", linewidth=1.0)
        axes.set(title=body, xlabel="rows", ylim=(0.0, None))
    np.atleast_1d(all_axes)[0].set_ylabel("relRMSE of gloss")
    np.atleast_1d(all_axes)[0].legend()
    figure.savefig(file, dpi=80)
    plt.close(figure)


def main(folder: Path) -> None:
    """Measure all, and write what there is."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = list(measure())
    with (folder / "gloss_transfer.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([HEADER, *(each.cells for each in lines)])
    plot(folder / "gloss_rows.png", lines)
    print(table(HEADER, [each.cells for each in lines]))


if __name__ == "__main__":
    use_kernel_cache()
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
