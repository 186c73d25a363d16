"""Render every scene, session and mesh of a folder.

.venv/bin/python examples/batch.py FOLDER
"""

import sys
from pathlib import Path

import insitu

ENDINGS = (".toml", ".insitu", ".glb", ".obj", ".ply", ".stl")


def main(scenes: Path, folder: Path, resolution: tuple[int, int] = (512, 512)) -> dict[str, str]:
    """Writes a PNG of each file into the folder; by name what became of it."""
    said = {}
    for path in sorted(each for each in scenes.iterdir() if each.suffix.lower() in ENDINGS):
        try:
            scene = insitu.open(path, resolution=resolution)
            said[path.name] = str(scene.save(folder / f"{path.stem}.png"))
        except insitu.Error as error:  # one line; the next file may be sound
            said[path.name] = f"failed: {error}"
    return said


if __name__ == "__main__":
    out = Path("out/examples/batch")
    out.mkdir(parents=True, exist_ok=True)
    for name, text in main(Path(sys.argv[1]), out).items():
        print(f"{name}: {text}")
