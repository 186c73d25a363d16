"""Shadow catchers: objects that are not seen themselves, but the shadows that others throw on them are.

A picture of the whole scene has at a pixel the light C of a catcher, and a picture of the catchers and the emitters
alone the light W: what the same surface sends where nothing else stands there. With luminance Y, channel by channel,

    s = Y(min(C, W)) / Y(W)      the share of its light that is left in the shadow, 1 where W is black
    e = max(C - W, 0)            what other objects throw on it besides, such as bounces and caustics

the catcher's part of the pixel becomes black of alpha 1 - s, plus the light e. So over any background B it is s B + e.
Over W itself, its own picture without the others, that has the luminance of C: Y(s W + e) = Y(C); channel by channel it
is C where the shadow is grey. Rejected: s for each channel, which no file with one alpha can hold.

Both pictures come from the mode's own engine, which knows in each pixel the light of catchers and their share of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.document.shadow_catchers import catchers_alone
from app.document.view_state import Viewpoint
from app.project.project import Project
from engine.core.camera import centre_directions
from engine.light.environment import LUMINANCE
from engine.precompute.direct.pipeline import SkyState
from engine.render.data_layers import object_coverage, point_picture
from engine.render.still import with_alpha
from engine.scene.description import Camera
from engine.scene.primary_hits import PrimaryHits

Picture = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_ALL = 1.0 - 1e-4  # of what covers a pixel: catchers alone


def without_others(project: Project) -> Project | None:
    """The project with its catchers and what emits alone; None where it has no catcher."""
    alone = catchers_alone(project.document)
    return None if alone is None else project.edited(alone, Viewpoint())


def caught_objects(project: Project) -> tuple[int, ...]:
    """The catchers of a project, by their indices in its scene."""
    names = project.document.shadow_catchers
    return tuple(i for i, name in enumerate(project.object_names) if name in names)


def catcher_part(project: Project, hits: PrimaryHits, radiance: NDArray[np.floating]) -> Picture | None:
    """The part of catchers (H, W, 4) in a picture whose points reflect this radiance (P, 3): what they add to it, and
    the share of each pixel that they cover; None without catchers."""
    if not (objects := caught_objects(project)):
        return None
    own = np.where(np.isin(hits.objects, objects)[:, None], radiance, 0.0)
    return with_alpha(point_picture(hits, own), object_coverage(hits)[list(objects)].sum(axis=0))


def caught_shadows(whole: Picture, part: Picture, alone: Picture) -> Picture:
    """A picture (H, W, 4) with shadows of other objects in place of the catchers. whole: the picture of the scene;
    part: that of catchers in it; alone: that of catchers in the picture of them and what emits; (H, W, 4) each."""
    share = part[..., 3:].astype(np.float64)
    is_caught = share > 0.0
    if not is_caught.any() or not alone[..., 3].any():
        return whole
    seen, empty = _per_share(part), empty_light(alone, is_caught[..., 0])
    total = empty @ LUMINANCE
    left = np.where(total > 0.0, np.minimum(seen, empty) @ LUMINANCE / np.where(total > 0.0, total, 1.0), 1.0)
    excess = np.maximum(seen - empty, 0.0)
    # The catcher's own light leaves the pixel, and what is beyond it comes back.
    is_alone = is_caught & (share >= _ALL * whole[..., 3:])
    others = np.where(is_alone, 0.0, np.maximum(whole[..., :3] - part[..., :3], 0.0))
    others = np.where(is_caught, others, whole[..., :3])
    alpha = np.clip(whole[..., 3] - share[..., 0] * np.clip(left, 0.0, 1.0), 0.0, 1.0)
    return with_alpha(others + share * excess, alpha)


def empty_light(alone: Picture, wanted: NDArray[np.bool_] | None = None) -> Float64Array:
    """W (H, W, 3) of the part of catchers (H, W, 4) in a picture of these and what emits, as if they filled each pixel.
    Where they cover none of it, it is that of the nearest pixel of which they do; wanted (H, W): where that matters,
    None: everywhere."""
    from scipy.ndimage import distance_transform_edt

    values, known = _per_share(alone), alone[..., 3] > 0.0
    if known.all() or wanted is not None and known[wanted].all():
        return values
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])


def over_sky(picture: Picture, sky: SkyState, camera: Camera) -> Picture:
    """A picture (H, W, 4) over the environment that a camera sees (H, W, 3)."""
    if sky.environment is None:
        return picture[..., :3]
    height, width, _ = picture.shape
    directions = centre_directions(camera, (width, height))
    behind = sky.environment.evaluate(directions.reshape(-1, 3), sky.rotation).reshape(directions.shape)
    return np.asarray(picture[..., :3] + (1.0 - picture[..., 3:]) * np.float32(sky.scale) * behind, np.float32)


def _per_share(part: Picture) -> Float64Array:
    """The light (H, W, 3) of catchers, as if they filled each pixel that they share in; 0 elsewhere."""
    share = part[..., 3:].astype(np.float64)
    return np.where(share > 0.0, part[..., :3] / np.where(share > 0.0, share, 1.0), 0.0)
