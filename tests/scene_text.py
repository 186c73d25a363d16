"""The text of small scenes, as their files have it: a camera, then an environment and objects, one after another."""

from collections.abc import Sequence


def camera(
    position: Sequence[float], fov_y: float | None = None, resolution: Sequence[int] | None = None,
    target: Sequence[float] = (0, 0, 0), head: str = "",
) -> str:  # fmt: skip
    """The beginning of a scene; what is None is left to its default. head: lines that stand before its camera."""
    text = f"version = 1\n{head}[camera]\nposition = {list(position)}\ntarget = {list(target)}\n"
    if fov_y is not None:
        text += f"fov_y = {fov_y}\n"
    if resolution is not None:
        text += f"resolution = {list(resolution)}\n"
    return text


def environment(radiance: float | Sequence[float] = (1, 1, 1), file: str = "") -> str:
    """An even sky, or the one in a file beside the scene."""
    if file:
        return f'[environment]\nfile = "{file}"\n'
    return f"[environment]\nradiance = {list(radiance) if isinstance(radiance, Sequence) else radiance}\n"


def placed(name: str, shape: str, transform: str = "", more: str = "") -> str:
    """An object. shape: a primitive, or a mesh's file, which has a point in its name; transform: 16 numbers row by row;
    more: what else is said of it (`layer = [...]`)."""
    kind = "mesh" if "." in shape else "primitive"
    where = f"transform = [{transform}]\n" if transform else ""
    return f'[[object]]\nname = "{name}"\n{kind} = "{shape}"\n{where}{more}'


def material(*each: str) -> str:
    """What a surface is made of: of each layer its `model = ...` and its values."""
    return f"layer = [{', '.join(f'{{ {layer} }}' for layer in each)}]\n"


LAMBERT = material('model = "lambert"')


def scaled(size: float | Sequence[float], at: Sequence[float] = (0, 0, 0)) -> str:
    """The transform that scales by a factor, or by one an axis, and moves the origin to a place."""
    (a, b, c), (x, y, z) = size if isinstance(size, Sequence) else (size, size, size), at
    return f"{a},0,0,{x}, 0,{b},0,{y}, 0,0,{c},{z}, 0,0,0,1"


def facing_up(size: float, at: Sequence[float] = (0, 0, 0)) -> str:
    """The transform of a quad that lies: scaled, its front (+Z) turned to +Y, its middle at a place."""
    x, y, z = at
    return f"{size},0,0,{x}, 0,0,{size},{y}, 0,{-size},0,{z}, 0,0,0,1"


def facing_down(size: float, at: Sequence[float]) -> str:
    """The transform of a quad that looks down, as a lamp does: its front turned to -Y."""
    x, y, z = at
    return f"{size},0,0,{x}, 0,0,{-size},{y}, 0,{size},0,{z}, 0,0,0,1"


def ground(
    resolution: tuple[int, int], radiance: Sequence[float] = (0.4, 0.5, 0.7), gloss: bool = False, bounces: int = 1,
    size: float = 9,
) -> str:  # fmt: skip
    """A diffuse ground, `size` m wide, under an even sky, and a second layer of gloss on it where that is asked for."""
    surface = material('model = "lambert"', 'model = "rough_conductor"') if gloss else LAMBERT
    return (
        camera((0.4, 1.6, 2.6), 45, resolution, (0, 0.3, 0), f"bounces = {bounces}\n")
        + environment(radiance)
        + placed("ground", "quad", facing_up(size), surface)
    )


# A table 4 m wide under what stands at the origin, and a lamp over it.
LIT_TABLE = placed("table", "quad", "4,0,0,0, 0,0,1,-0.5, 0,-4,0,0, 0,0,0,1", f"smooth = false\n{LAMBERT}") + placed(
    "lamp", "quad", facing_down(1, (0.6, 1.6, 0.2)), "emission = [3.0, 4.0, 5.0]\n"
)
# A lamp half a metre wide, to the upper left behind what stands at the origin, that leans towards it.
LEANING_LAMP = placed(
    "lamp", "quad", "0.5,0,0,-0.8, 0,0.35,-0.35,1.05, 0,0.35,0.35,-0.6, 0,0,0,1", "emission = [9, 7, 5]\n"
)
