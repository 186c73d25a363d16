"""Shadow catchers: objects that are not seen themselves, but the shadows that others throw on them are.

A picture of the whole scene has at a pixel the light C of a catcher, and a picture of the catchers and the emitters
alone the light W: what the same surface sends where nothing else stands there. With luminance Y, channel by channel,

    s = Y(min(C, W)) / Y(W)      the share of its light that is left in the shadow, 1 where W is black
    e = max(C - W, 0)            what other objects throw on it besides, such as bounces and caustics

the catcher's part of the pixel becomes black of alpha 1 - s, plus the light e. So over any background B it is s B + e.
Over W itself, its own picture without the others, that has the luminance of C: Y(s W + e) = Y(C); channel by channel it
is C where the shadow is grey. Rejected: s for each channel, which no file with one alpha can hold.

Both pictures come from the mode's own engine. In pixels that a catcher shares with other objects, Placement and paths
know C by their points. Orbit and Deform do not: there C / W is that of the nearest pixel of a catcher alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.document.shadow_catchers import catchers_alone
from app.document.view_state import Viewpoint
from app.project.project import Project
from engine.light.environment import LUMINANCE
from engine.precompute.direct.pipeline import SkyState
from engine.render.data_layers import object_coverage, point_picture
from engine.render.still import with_alpha
from engine.scene.primary_hits import PrimaryHits

Picture = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_ALL = 1.0 - 1e-4  # of what covers a pixel: a catcher alone


@dataclass(frozen=True, eq=False)
class CatcherView:
    """What the camera sees of catchers. share (H, W): of each pixel that they cover; is_alone (H, W): whether nothing
    else covers it; directions (H, W, 3): of the rays through pixels' centres, world."""

    share: Float64Array
    is_alone: NDArray[np.bool_]
    directions: NDArray[np.float32]


def without_others(project: Project) -> Project | None:
    """The project with its catchers and what emits alone; None where it has no catcher."""
    alone = catchers_alone(project.document)
    return None if alone is None else project.edited(alone, Viewpoint())


def catcher_view(project: Project, hits: PrimaryHits) -> CatcherView:
    """What the camera of these hits sees of the project's catchers."""
    catches = [project.document.object(name).shadow_catcher for name in project.object_names]
    share = object_coverage(hits)[catches].sum(axis=0).astype(np.float64)
    covered = 1.0 - hits.open_image
    return CatcherView(share, (share > 0.0) & (share >= _ALL * covered), hits.ray_directions)


def catcher_light(project: Project, hits: PrimaryHits, radiance: NDArray[np.floating]) -> Float64Array | None:
    """What catchers add to a picture (H, W, 3) in which points reflect this radiance (P, 3); None without catchers."""
    if not project.document.shadow_catchers:
        return None
    catches = np.array([project.document.object(name).shadow_catcher for name in project.object_names])
    own = np.where(catches[hits.objects][:, None], radiance, 0.0)
    return point_picture(hits, own).astype(np.float64)


def caught_shadows(
    whole: Picture, alone: Picture, view: CatcherView, view_alone: CatcherView, light: Float64Array | None = None
) -> Picture:
    """A picture (H, W, 4) with shadows of other objects in place of the catchers. whole, alone: pictures (H, W, 4) of
    the scene, and of catchers and emitters; views: what the camera sees of catchers in both; light (H, W, 3): what they
    add to the first, None where that is not known."""
    if not view.is_alone.any() or not view_alone.is_alone.any():
        return whole
    empty, share = empty_light(alone, view_alone), view.share[..., None]
    if light is None:
        seen = _per_share(whole, view)
        ratio = np.where(empty > 0.0, seen / np.where(empty > 0.0, empty, 1.0), 1.0)
        seen = np.where(view.is_alone[..., None], seen, _filled(ratio, view.is_alone) * empty)
    else:
        seen = light / np.where(share > 0.0, share, 1.0)
    total = empty @ LUMINANCE
    left = np.where(total > 0.0, np.minimum(seen, empty) @ LUMINANCE / np.where(total > 0.0, total, 1.0), 1.0)
    excess = np.maximum(seen - empty, 0.0)
    # The catcher's own light leaves the pixel, and what is beyond it comes back.
    others = np.where(view.is_alone[..., None], 0.0, np.maximum(whole[..., :3] - share * seen, 0.0))
    others = np.where(share > 0.0, others, whole[..., :3])
    alpha = np.clip(whole[..., 3] - view.share * np.clip(left, 0.0, 1.0), 0.0, 1.0)
    return with_alpha(others + share * excess, alpha)


def empty_light(alone: Picture, view_alone: CatcherView) -> Float64Array:
    """W (H, W, 3), in each pixel of a picture of catchers and emitters alone, as if catchers filled it."""
    return _filled(_per_share(alone, view_alone), view_alone.is_alone)


def over_sky(picture: Picture, sky: SkyState, directions: NDArray[np.float32]) -> Picture:
    """A picture (H, W, 4) over the environment (H, W, 3); directions (H, W, 3): of the rays through pixels."""
    if sky.environment is None:
        return picture[..., :3]
    behind = sky.environment.evaluate(directions.reshape(-1, 3), sky.rotation).reshape(directions.shape)
    return np.asarray(picture[..., :3] + (1.0 - picture[..., 3:]) * np.float32(sky.scale) * behind, np.float32)


def _per_share(picture: Picture, view: CatcherView) -> Float64Array:
    """The light (H, W, 3) of catchers in pixels that they cover alone, as if they filled them; 0 elsewhere."""
    alpha = picture[..., 3:].astype(np.float64)
    is_there = view.is_alone[..., None] & (alpha > 0.0)
    return np.where(is_there, picture[..., :3] / np.where(is_there, alpha, 1.0), 0.0)


def _filled(values: Float64Array, known: NDArray[np.bool_]) -> Float64Array:
    """Values (H, W, 3) with those of the nearest known pixel where they are not."""
    from scipy.ndimage import distance_transform_edt

    if known.all():
        return values
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])
