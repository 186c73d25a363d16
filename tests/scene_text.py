"""The text of small scenes, as their files have it."""

from collections.abc import Sequence


def camera(
    position: Sequence[float], fov_y: float, resolution: Sequence[int], target: Sequence[float] = (0, 0, 0),
    head: str = "",
) -> str:  # fmt: skip
    """The beginning of a scene; head: lines that stand before its camera."""
    return (
        f"version = 1\n{head}[camera]\nposition = {list(position)}\ntarget = {list(target)}\nfov_y = {fov_y}\n"
        f"resolution = {list(resolution)}\n"
    )


def placed(name: str, primitive: str, transform: str = "", more: str = "") -> str:
    """An object: its transform as 16 numbers row by row, and what else is said of it (`layer = [...]`)."""
    where = f"transform = [{transform}]\n" if transform else ""
    return f'[[object]]\nname = "{name}"\nprimitive = "{primitive}"\n{where}{more}'


def ground(
    resolution: tuple[int, int], radiance: str = "[0.4, 0.5, 0.7]", gloss: bool = False, bounces: int = 1
) -> str:
    """A matt ground of 18 m under an even sky, and a second layer of gloss on it where that is asked for."""
    layers = '{ model = "lambert" }' + (', { model = "rough_conductor" }' if gloss else "")
    return (
        camera((0.4, 1.6, 2.6), 45, resolution, (0, 0.3, 0), f"bounces = {bounces}\n")
        + f"[environment]\nradiance = {radiance}\n"
        + placed("ground", "quad", "9,0,0,0, 0,0,9,0, 0,-9,0,0, 0,0,0,1", f"layer = [{layers}]\n")
    )
