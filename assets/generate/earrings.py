"""Earrings, after [BenArtzi07, fig. 4.5]: two pearls on metal posts, lying on a cloth draped over a round pedestal.

The cloth is a surface over polar coordinates (distance s along the cloth from its middle, azimuth phi): flat on the
pedestal, bent over its edge, then hanging, in folds that deepen downward. Metres: the pearls measure 13 mm.
"""

import numpy as np

from .mesh import Floats, Mesh, cleaned, merged
from .shapes import sphere
from .surfaces import carried, circle, parametric, rounded_profile, tube

PEDESTAL = 0.024  # radius of the flat top
EDGE = 0.005  # radius of the bend at its edge
CLOTH = 0.086  # radius of the cloth
PEARL = 0.0065
POST = 0.00050
# Each earring: where its pearl lies (x, z) and the azimuth that its post points to.
EARRINGS = (((-0.0092, 0.0048), np.radians(12)), ((0.0085, -0.0072), np.radians(-168)))


def meshes() -> dict[str, Mesh]:
    placed = [(_pearl_centre(at), _post_direction(at, azimuth)) for at, azimuth in EARRINGS]
    pearls = merged([_moved(sphere(PEARL, 65, 128), centre) for centre, _ in placed])
    posts = merged([_post(centre, direction) for centre, direction in placed])
    return {"pearls": pearls, "posts": posts, "cloth": cloth(), "pedestal": pedestal()}


def _moved(mesh: Mesh, by: Floats) -> Mesh:
    return Mesh(mesh.positions + by, mesh.normals, mesh.faces)


def cloth() -> Mesh:
    s = np.concatenate([np.linspace(0, PEDESTAL - 0.002, 45), np.linspace(PEDESTAL - 0.002, CLOTH, 76)[1:]])
    phi = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    s[0] = 1e-4  # azimuth means nothing at 0: a fan closes the middle
    around = parametric(_cloth_point, s, phi, wrap=True)
    rim = np.arange(len(phi))
    fan = np.column_stack([rim, np.roll(rim, -1), np.full(len(phi), len(phi))])
    positions, normals = (
        np.vstack([a[: len(phi)], a[: len(phi)].mean(axis=0)]) for a in (around.positions, around.normals)
    )
    return cleaned(merged([around, Mesh(positions, normals, fan)]))


def _cloth_point(s: Floats, phi: Floats) -> Floats:
    """(N, 3) of the cloth at distance s along it and azimuth phi."""
    bend = np.clip((s - PEDESTAL) / EDGE, 0, np.pi / 2)
    hang = np.maximum(s - PEDESTAL - EDGE * np.pi / 2, 0)
    radius = np.minimum(s, PEDESTAL) + EDGE * np.sin(bend)
    height = -EDGE * (1 - np.cos(bend)) - hang
    depth = np.maximum(s - PEDESTAL, 0)
    fold = 0.5 + 0.5 * np.sin(_fold_phase(phi))
    deepening = depth**2 / (depth + 0.03)
    radius = radius + deepening * (0.62 * fold + 0.10 * np.sin(5 * phi + 0.7))
    height = height + 0.24 * deepening * fold
    azimuth = phi + 0.030 * np.sin(2 * _fold_phase(phi)) * deepening / (deepening + 0.03)
    x, z = radius * np.cos(azimuth), radius * np.sin(azimuth)
    return np.stack([x, height + _wrinkles(x, z, s), z], axis=-1)


def _fold_phase(phi: Floats) -> Floats:
    """Nine folds of unequal width."""
    return 9 * phi + 1.1 * np.sin(2 * phi + 0.4) + 0.7 * np.sin(3 * phi + 2.1)


def _wrinkles(x: Floats, z: Floats, s: Floats) -> Floats:
    """Soft waves on the top and a dent below each pearl; height in metres."""
    waves = 0.00075 * np.sin(130 * x + 70 * z + 0.5) * np.sin(95 * z - 60 * x + 1.2)
    crease = 310 * x - 170 * z + 1.3 * np.sin(150 * z + 90 * x)
    waves = waves + 0.00042 * np.sin(crease) * (0.6 + 0.4 * np.sin(120 * x + 140 * z)) * np.exp(-((s / 0.03) ** 4))
    for at, _ in EARRINGS:
        waves = waves - 0.0011 * np.exp(-((x - at[0]) ** 2 + (z - at[1]) ** 2) / (0.9 * PEARL) ** 2)
    return waves


def _height_on_top(x: float, z: float) -> float:
    return float(_wrinkles(np.array([x]), np.array([z]), np.array([np.hypot(x, z)]))[0])


def _pearl_centre(at: tuple[float, float]) -> Floats:
    return np.array([at[0], _height_on_top(*at) + 0.985 * PEARL, at[1]])


POST_LENGTH = 0.0150  # from the pearl's middle


def _post_direction(at: tuple[float, float], azimuth: float) -> Floats:
    """Unit direction of a post that lies with its tip on the cloth."""
    level = np.sqrt(POST_LENGTH**2 - PEARL**2)
    tip = np.array(at) + level * np.array([np.cos(azimuth), np.sin(azimuth)])
    rise = _height_on_top(*tip) + 1.6 * POST - _pearl_centre(at)[1]
    direction = np.array([level * np.cos(azimuth), rise, level * np.sin(azimuth)])
    return direction / np.linalg.norm(direction)


def _post(centre: Floats, direction: Floats) -> Mesh:
    """The wire with a groove near its tip, and the round seat that the pearl is glued to."""
    along = np.concatenate(
        [np.linspace(0.9 * PEARL, POST_LENGTH - 0.003, 12), np.linspace(POST_LENGTH - 0.003, POST_LENGTH, 25)[1:]]
    )
    radius = POST * (1 - 0.35 * np.exp(-(((along - POST_LENGTH + 0.0014) / 0.00035) ** 2)))
    wire = tube(centre + along[:, None] * direction, radius, 32)
    seat = rounded_profile(
        [
            (0, 0, 0),
            (0.0026, 0, 0.0003),
            (0.0026, 0.0007, 0.0003),
            (0.0008, 0.0010, 0.0005),
            (POST, 0.0022, 0.0003),
            (0, 0.0022, 0),
        ]  # fmt: skip
    )
    across = np.cross(direction, (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across)
    frame = np.column_stack([across, direction, np.cross(across, direction)])
    cup = carried(seat, circle(48))
    placed = Mesh(cup.positions @ frame.T + centre + 0.905 * PEARL * direction, cup.normals @ frame.T, cup.faces)
    return merged([wire, placed])


def pedestal() -> Mesh:
    """What holds the cloth up, just beneath it; it shows below the hem."""
    profile = rounded_profile([(0, -0.20, 0), (0.0245, -0.20, 0.002), (0.0245, -0.0045, 0.003), (0, -0.0045, 0)])
    return carried(profile, circle(96))
