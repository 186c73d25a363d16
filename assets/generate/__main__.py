"""`python -m assets.generate [NAME ...]`: write the meshes and images of all scenes and all environments, or those
named."""

import sys
from pathlib import Path

from PIL import Image

from .environments import ENVIRONMENTS
from .mesh import check, save_ply
from .panorama import save_exr
from .scenes import IMAGES, LIT_BY, MODELS, SCENES, SINGLE_MODELS

ASSETS = Path(__file__).resolve().parents[1]


def generate(names: list[str], folder: Path = ASSETS) -> list[Path]:
    """Write the named assets into `folder`, each mesh checked first; returns what was written."""
    written = []
    for name, meshes in SCENES.items():
        if name in names:
            target = folder / "scenes" / name
            target.mkdir(parents=True, exist_ok=True)
            for part, mesh in meshes().items():
                check(mesh)
                save_ply(mesh, target / f"{part}.ply")
                written.append(target / f"{part}.ply")
            for file, pixels in IMAGES.get(name, dict)().items():
                Image.fromarray(pixels).save(target / file, optimize=True, quality=88)
                written.append(target / file)
    for name, models in MODELS.items():
        for file, save in models.items() if name in names else ():
            (folder / "scenes" / name).mkdir(parents=True, exist_ok=True)
            save(folder / "scenes" / name / file)
            written.append(folder / "scenes" / name / file)
    for name, save in SINGLE_MODELS.items():
        if name in names:
            (folder / "models").mkdir(parents=True, exist_ok=True)
            save(folder / "models" / f"{name}.glb")
            written.append(folder / "models" / f"{name}.glb")
    for name, picture in ENVIRONMENTS.items():
        if name in names:
            target = folder / "environments"
            image = picture()
            scenes = [folder / "scenes" / scene for scene, environment in LIT_BY.items() if environment == name]
            for place in [target, *scenes]:
                place.mkdir(parents=True, exist_ok=True)
                save_exr(image, place / f"{name}.exr")
                written.append(place / f"{name}.exr")
    return written


def main() -> None:
    known = [*SCENES, *MODELS, *SINGLE_MODELS, *ENVIRONMENTS]
    names = sys.argv[1:] or known
    unknown = sorted(set(names) - set(known))
    if unknown:
        sys.exit(f"unknown: {', '.join(unknown)}; known: {', '.join(known)}")
    for path in generate(names):
        print(f"{path.stat().st_size / 1024:8.0f} KiB  {path.relative_to(ASSETS)}")


if __name__ == "__main__":
    main()
