"""The built-in scenes, environments and materials: their names and files.

The files are in `assets/` beside the `engine` package, in a checkout and in an installed copy alike.
"""

from pathlib import Path

ASSETS = Path(__file__).resolve().parents[2] / "assets"
DEFAULT_SCENE = "teatray"
EMPTY_SCENE = "empty"


def builtin_scenes() -> dict[str, Path]:
    """Name -> scene.toml, the default scene first, the others by name."""
    found = {path.parent.name: path for path in sorted((ASSETS / "scenes").glob("*/scene.toml"))}
    return {name: found[name] for name in sorted(found, key=lambda name: (name != DEFAULT_SCENE, name))}


def scene_path(source: str) -> Path:
    """The file of a scene: of a built-in one by its name, else the path itself."""
    return builtin_scenes().get(source) or Path(source)


def builtin_environments() -> dict[str, Path]:
    """Name -> lat-long EXR, by name."""
    return {path.stem: path for path in sorted((ASSETS / "environments").glob("*.exr"))}


def builtin_materials() -> list[Path]:
    """The files of the library's materials, by name."""
    return sorted((ASSETS / "materials").glob("*.toml"))
