"""Deform's moving pictures on a graphics card, timed: `python -m benchmarks.programs.deform OUT.json`.

A program of its own, as `orbit`. Each frame has another pose: its places are computed as by the worker, sent,
and drawn, and glFinish ends it. What is left out is the way between the two processes.
"""

from __future__ import annotations

import sys
import time

import moderngl

from benchmarks.deform import DeformEffort, mesh_for_frames
from benchmarks.programs.command_line import Figures, command_line, write_found
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.realtime.zonal_harmonics.pose import Deformation
from ui.gl.context import GraphicsError, create_headless_context, describe_context, shader_bytes
from ui.modes.deform.gl.posed_picture import PosedPicture

WARM_UP = 3


def frame_rates(context: moderngl.Context, effort: DeformEffort, is_glossy: bool) -> list[float]:
    """Frames a second, one each."""
    deform = mesh_for_frames(effort)
    if is_glossy:
        deform.set_layers({0: (make_layer(MODELS["rough_conductor"], {"alpha": 0.4}),)})
    picture, camera, rates = PosedPicture(context), deform.scene.description.camera, []
    for i in range(WARM_UP + effort.n_frames):
        begun = time.perf_counter()
        exported = deform.export_picture(camera, (("relief", (Deformation("bend", 1.0 + i),)),), picture.part_numbers)
        picture.draw(exported, camera, effort.resolution)
        context.finish()
        rates.append(1.0 / (time.perf_counter() - begun))
    picture.release()
    return rates[WARM_UP:]


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("deform", __doc__)
    parser.add_argument("--frames", type=int, default=40)
    given = parser.parse_args(arguments)
    return write_found(given.output, lambda: measure(given.frames))


def measure(n_frames: int) -> Figures:
    """Frames a second of a diffuse and of a glossy relief. Raises InsituError where shaders do not draw."""
    context = create_headless_context()
    if not shader_bytes(context):
        raise GraphicsError(f"no graphics card with OpenGL 4.3 ({describe_context(context)})")
    effort = DeformEffort(n_frames=n_frames)
    rates = {name: frame_rates(context, effort, name == "glossy") for name in ("diffuse", "glossy")}
    return {"renderer": describe_context(context), **rates}


if __name__ == "__main__":
    sys.exit(main())
