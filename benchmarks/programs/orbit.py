"""Orbit's moving pictures in shaders, timed: `python -m benchmarks.programs.orbit SCENE OUT.json`.

A program of its own, as `renderer`. Where OpenGL is software it ends at once: nobody waits for shaders there, unless
`INSITU_MOVING` asks for them. Every time ends with glFinish.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from app.project.project import open_project
from app.stills.stills import layers_by_object
from benchmarks.programs.command_line import Figures, command_line, write_found
from engine.realtime.triple_product.gpu_export import PointExporter
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.scene.camera_moves import orbit_camera
from engine.scene.description import Camera
from ui.gl.context import GraphicsError, create_headless_context, describe_context, shader_bytes
from ui.modes.orbit.gl.shaded_picture import ShadedPicture

COUNTS = (80, 320)  # coefficients a point
WARM_UP = 3
DEGREES_A_FRAME = 3.0


def measure(source: str, resolution: tuple[int, int], n_points: int, n_frames: int) -> Figures:
    """Frames a second by coefficients a point, and the seconds of uploading all that they are drawn of.

    Raises InsituError where shaders do not draw.
    """
    context = create_headless_context()
    most_bytes = shader_bytes(context)
    if not most_bytes:
        raise GraphicsError(f"no graphics card with OpenGL 4.3 ({describe_context(context)})")
    project = open_project(source, resolution)
    orbit, shaded = Orbit(project.scene, n_points=n_points), ShadedPicture(context)
    orbit.set_light(project.sky)
    orbit.set_layers(layers_by_object(project))
    for _ in orbit.work():
        pass
    begun = time.perf_counter()
    for part in PointExporter(most_bytes).parts(orbit):
        shaded.buffers.take(part)
    context.finish()
    uploaded = time.perf_counter() - begun
    rates = {}
    for n in COUNTS:
        cameras = [_turned(project.scene.description.camera, k) for k in range(WARM_UP + n_frames)]
        rates[str(n)] = [1.0 / _seconds(shaded, camera, resolution, n) for camera in cameras][WARM_UP:]
    found = {"renderer": describe_context(context), "fps": rates, "told_s": uploaded, "mb": shaded.memory_bytes / 1e6}
    shaded.release()
    return found


def _turned(camera: Camera, k: int) -> Camera:
    moved = orbit_camera(camera, np.radians(DEGREES_A_FRAME) * k, 0.0)
    return camera.model_copy(update={"position": moved.position})


def _seconds(shaded: ShadedPicture, camera: Camera, resolution: tuple[int, int], n: int) -> float:
    begun = time.perf_counter()
    shaded.draw(camera, resolution, n)
    shaded.finish()
    return time.perf_counter() - begun


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("orbit", __doc__, "source")
    parser.add_argument("--resolution", nargs=2, type=int, default=(1024, 768))
    parser.add_argument("--points", type=int, default=256 * 256)
    parser.add_argument("--frames", type=int, default=60)
    given = parser.parse_args(arguments)
    return write_found(given.output, lambda: measure(given.source, tuple(given.resolution), given.points, given.frames))


if __name__ == "__main__":
    sys.exit(main())
