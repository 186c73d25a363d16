"""Scripted drags in the window, and the jump when they end: `python -m benchmarks.programs.drags SCENE OUT.json`.

Each drag edits one material in a dozen frames. Its last frame, with all increments of direct light, is compared with
the picture when nothing more comes: the mean change, and that of the 8 × 8 block that changes most, in 8-bit values of
the screen. The editor, the worker process and the renderer are the real ones.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetParameter
from app.document.view_state import SetView
from benchmarks.programs.command_line import Figures, Pictures, command_line, resolution_of, write_found
from benchmarks.programs.renderer import EditorRig
from engine.core.errors import InsituError
from engine.curve.operators import HALF_PI, Operator
from engine.material.layer import object_of
from ui.picture_feed import ViewportStill

N_FRAMES, BLOCK = 12, 8
FRESNEL = "theta_d"
# The power of α with which each parameter of roughness goes: an exponent n is 2 / α² - 2, or about that.
ROUGHNESS = {"alpha": 1, "n_u": -2, "n_v": -2}
TINT = (1.0, 0.7, 0.4)


@dataclass(frozen=True)
class Drag:
    """A drag of a layer, key, with one of its curves selected; command: for the fraction of the drag that is done."""

    key: str
    curve: str
    kind: str
    command: Callable[[float], object]


def drags_of(rig: EditorRig, key: str) -> list[Drag]:
    """The drags of a glossy layer: roughness up and down, a shoulder that doubles the light beside its highlight, and
    its colour at normal incidence."""
    layer = rig.editor.document.layer(key)
    highlight, *others = (factor.name for factor in layer.model.factors)
    drags = []
    for name, power in ROUGHNESS.items():
        if name in layer.values:

            def rougher(times: float, name: str = name, power: int = power) -> Callable[[float], object]:
                value = float(layer.values[name])  # type: ignore[arg-type]
                return lambda done: SetParameter(key, name, value * times ** (power * done))

            curve = others[0] if name == "n_v" else highlight
            drags += [
                Drag(key, curve, f"{name} {word}", rougher(n)) for word, n in (("rougher", 1.6), ("smoother", 0.625))
            ]

    def shoulder(done: float) -> object:
        lift = (Operator("amplify", "y", 0.0, 0.05, 0.35, 0.6, 1.0 + done),) if done else ()
        return SetOperators(key, highlight, lift)

    tinted = FRESNEL if FRESNEL in others else highlight

    def colour(done: float) -> object:
        channels = {1: (False, True, False), 2: (False, False, True)}
        dims = [Operator("amplify", "y", 0.0, 0.0, HALF_PI, HALF_PI, TINT[c] ** done, 0.0, channels[c]) for c in (1, 2)]
        return SetOperators(key, tinted, tuple(dims) if done else ())

    return [*drags, Drag(key, highlight, "shoulder", shoulder), Drag(key, tinted, "colour", colour)]


@dataclass(frozen=True)
class Jump:
    """mean and worst block of the change, 8-bit values; ms: of each frame of the drag."""

    mean: float
    block: float
    ms: tuple[float, ...]


def jump_after(rig: EditorRig, drag: Drag) -> tuple[Jump, np.ndarray, np.ndarray]:
    """The jump after a drag, which is taken back; the pictures (H, W, 3) of its last frame and in the end, in screen
    values."""
    milliseconds = []
    for i in range(1, N_FRAMES + 1):
        started = time.perf_counter()
        do(rig, drag.command(i / N_FRAMES))
        rig.frame()
        milliseconds.append(1e3 * (time.perf_counter() - started))
    while rig.feed.is_behind:
        rig.frame()
    last = shown(rig)
    rig.wait_until_exact()
    final = shown(rig)
    do(rig, drag.command(0.0))
    rig.wait_until_exact()
    change = np.abs(final - last).mean(axis=2)
    return Jump(255.0 * float(change.mean()), 255.0 * worst_block(change), tuple(milliseconds)), last, final


def do(rig: EditorRig, command: object) -> None:
    refused = rig.editor.do(command)  # type: ignore[arg-type]
    if refused is not None:
        raise InsituError(refused)


def shown(rig: EditorRig) -> np.ndarray:
    """The picture in screen values, (H, W, 3)."""
    still = rig.feed.still(rig.editor)
    assert isinstance(still, ViewportStill)
    return np.clip(still.shown, 0.0, 1.0)


def worst_block(change: np.ndarray) -> float:
    """The greatest mean of a block of 8 × 8 pixels of a change (H, W)."""
    height, width = (n - n % BLOCK for n in change.shape)
    blocks = change[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK)
    return float(blocks.mean(axis=(1, 3)).max(initial=0.0))


def measure(
    source: str, resolution: tuple[int, int] | None, keys: Sequence[str], n_bounces: int | None, alpha: float | None
) -> tuple[Figures, Pictures]:
    """The jumps of all drags of these layers, "key kind" → mean, block and milliseconds; and pictures of each.
    n_bounces: those of the scene where None; alpha: set for all the layers first."""
    figures: Figures = {}
    pictures: Pictures = {}
    with contextlib.closing(EditorRig(source, resolution)) as rig:
        if n_bounces is not None:
            do(rig, SetView.of(n_bounces=n_bounces))
        for key in keys:
            if alpha is not None:
                do(rig, SetParameter(key, "alpha", alpha))
        rig.wait_until_exact()
        for key in keys:
            for drag in drags_of(rig, key):
                rig.switch(f"{key}.{drag.curve}")
                jump, last, final = jump_after(rig, drag)
                name = f"{object_of(key)} {drag.kind}"
                figures[name] = {"mean": jump.mean, "block": jump.block, "ms": jump.ms}
                pictures |= {f"{name} last": last, f"{name} final": final}
                print(f"{source}: {name}: mean {jump.mean:.2f}, block {jump.block:.2f}, "
                      f"{np.median(jump.ms):.0f} ms a frame, {max(jump.ms):.0f} at most", flush=True)  # fmt: skip
    return figures, pictures


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("drags", __doc__, "source")
    parser.add_argument("--resolution", nargs=2, type=int)
    parser.add_argument("--layer", action="append", required=True)
    parser.add_argument("--bounces", type=int)
    parser.add_argument("--alpha", type=float, help="roughness of the layers at the start")
    given = parser.parse_args(arguments)
    return write_found(
        given.output,
        lambda: measure(given.source, resolution_of(given), given.layer, given.bounces, given.alpha),
    )


if __name__ == "__main__":
    sys.exit(main())
