"""A turntable in Orbit: light is found once, then only the camera moves.

.venv/bin/python examples/turntable.py
"""

from pathlib import Path

import insitu


def main(
    folder: Path, resolution: tuple[int, int] = (512, 512), n_frames: int = 24, name: str = "teatray"
) -> list[Path]:
    """Writes frame_000.png and on, once around the scene of that name; their paths."""
    scene = insitu.open(name, resolution=resolution)
    paths = []
    for i in range(n_frames):
        paths.append(scene.save(folder / f"frame_{i:03d}.png", "orbit", bounces=1))
        scene.camera.orbit(360 / n_frames)
    return paths


if __name__ == "__main__":
    out = Path("out/examples/turntable")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
