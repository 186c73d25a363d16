"""A recorded drag of the ring's roughness, after [BenArtzi07, fig. 6.5]:
`python -m benchmarks.programs.recorded_drag OUT.png`.

Eight frames of the window's picture while roughness rises, each drawn from what was frozen before the drag: the caustic
widens in the frame of each step, and nothing is traced in between. An animated PNG.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from app.document.commands.layers import SetParameter
from benchmarks.programs.renderer import EditorRig
from engine.core.errors import InsituError
from ui.picture_feed import ViewportStill

SCENE, LAYER, CURVE = "ring", "ring.gold", "ring.gold.theta_h"
RESOLUTION = (384, 384)
# The part of the picture that is kept: the ring and its caustic.
LEFT, TOP, WIDTH, HEIGHT = 56, 60, 320, 272
N_FRAMES, FRAME_MS, LAST_MS = 8, 200, 1200
ROUGHEST = 0.2


def frames(resolution: tuple[int, int] = RESOLUTION, n_frames: int = N_FRAMES) -> list[np.ndarray]:
    """The pictures (H, W, 3) sRGB of the drag, from the scene's own roughness on."""
    found = []
    with contextlib.closing(EditorRig(SCENE, resolution)) as rig:
        alpha = float(rig.editor.document.layer(LAYER).values["alpha"])  # type: ignore[arg-type]
        rig.switch(CURVE)
        for i in range(n_frames):
            _set_alpha(rig, alpha * (ROUGHEST / alpha) ** (i / (n_frames - 1)))
            rig.frame()
            while rig.feed.is_behind:
                rig.frame()
            still = rig.feed.still(rig.editor)
            assert isinstance(still, ViewportStill)
            found.append((255.0 * np.clip(still.shown, 0.0, 1.0) + 0.5).astype(np.uint8))
    return found


def _set_alpha(rig: EditorRig, alpha: float) -> None:
    refused = rig.editor.do(SetParameter(LAYER, "alpha", alpha))
    if refused is not None:
        raise InsituError(refused)


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    (path,) = sys.argv[1:] if arguments is None else arguments
    save([each[TOP : TOP + HEIGHT, LEFT : LEFT + WIDTH] for each in frames()], Path(path))
    return 0


def save(pictures: Sequence[np.ndarray], path: Path) -> None:
    """Write pictures (H, W, 3) sRGB as an animated PNG that rests on the last one."""
    first, *others = [Image.fromarray(each) for each in pictures]
    times = [FRAME_MS] * len(others) + [LAST_MS]
    first.save(path, save_all=True, append_images=others, duration=times, loop=0, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
