"""A still in layers, as compositing programs take them from one OpenEXR file.

| channels | |
| --- | --- |
| R, G, B | the picture; A too, multiplied into them, where the background is transparent |
| direct, indirect | light that surfaces reflect once, and more often |
| emission | what is seen of lamps and the environment |
| light_NAME | what one light, or one group of the mix, adds to the picture |
| background | what a background of one colour adds, only where there is one |
| shadow.A | the share of what is behind that shadows on catchers hide, only where there are some |
| albedo | the share of light that surfaces reflect |
| normal, position (X, Y, Z) and Z | at pixels' centres, in the scene's frame, and the depth along the camera's axis |
| mask_NAME.A | the share of each pixel that an object covers |
| error.Y | the estimated error of the picture, relative to its mean |

Light adds up [BenArtzi07, eq. 7.4]: each light is computed alone, with bounces of its own. So lights sum to the picture
less its background of one colour, as direct light, indirect light and emission do, and each may be scaled or coloured
afterwards. Of shadow catchers each light has its share of what other objects throw on them besides, by how much more it
sends them than it does without these; and the environment what they leave of it. Rejected: light by light from the
samples of one solution, whose glossy second bounces are those of all lights together.

Names are `layer.channel`, which Nuke and Blender show as layers; Blender's depth is Z as well. In names of objects
and lights, what is no letter, digit or "-" is "_": a dot would begin another layer. The second of equal names has _2.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.document.background import Background
from app.document.document import Document
from app.document.light_mix import emission_of, gains_of, lights_of, mixed_light
from app.document.light_state import RGB, group_key
from app.project.distant_light import sky_of
from app.project.project import Project
from app.stills.shadow_catcher import (
    catcher_part,
    caught_objects,
    caught_shadows,
    empty_light,
    over_sky,
    without_others,
)
from app.stills.stills import (
    Report,
    Still,
    StillParts,
    finished_picture,
    still_parts,
    still_settings,
    with_intensity,
)
from engine.core.generators import StillProgress, run_to_end
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.data_layers import albedo_layer, object_coverage, point_picture, surface_layers
from engine.render.display import PictureLayer
from engine.render.error_estimate import MAP_POINTS, PointErrors, error_map, estimate_point_errors
from engine.render.still import compose, reflect_layers, with_alpha
from engine.scene.primary_hits import PrimaryHits, emission_picture

# Share of the time that indirect light takes, for an even progress bar.
INDIRECT = 0.75

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _LitPart:
    """What some of the lights add: radiance (P, 3) that points reflect, directly and indirectly; emission (H, W, 3):
    what is seen of them; noise: RMS radiance of that in the indirect light; sky, quality: by which it was computed;
    thrown (2, H, W, 3): what shadow catchers show of both, None where they are points like all others."""

    direct: Float64Array
    indirect: Float64Array
    emission: Float64Array
    noise: float
    sky: SkyState = SkyState(None)
    quality: Quality | None = None
    thrown: Float64Array | None = None


def render_layers(project: Project, report: Report, *, series: BounceSeries | None = None, **settings: Any) -> Still:
    """A still of a project in Placement with its layers; arguments: see `render_project`."""
    settings_of = still_settings(project, "placement", settings)
    parts = still_parts(project, settings_of, series)
    lights, alone = light_groups(project.document) or [("none", ())], without_others(project)
    ends = np.linspace(0.0, 1.0, len(lights) + 2)  # of the lights and the error, which take about as long
    lit = [
        _lit_part(parts, project, keys, _within(report, begin, end, name))
        for (name, keys), begin, end in zip(lights, ends[:-2], ends[1:-1], strict=True)
    ]
    whole = _sum(parts.placement.hits, lit)
    errors = _estimated_errors(parts, project.sky, whole, _within(report, ends[-2], 1.0, "error"))

    def shown(part: _LitPart) -> NDArray[np.float32]:
        """The light (H, W, 3) of a part."""
        return with_intensity(project.document, light_of(part))

    def light_of(part: _LitPart) -> Float64Array:
        """The same without the light's intensity."""
        light = point_picture(parts.placement.hits, part.direct + part.indirect) + part.emission
        return light if part.thrown is None else light + part.thrown.sum(axis=0)

    black, background = _black(parts.placement.hits), project.document.background
    alpha, shadow = 1.0 - parts.placement.hits.open_image, None
    if alone is not None:
        rest = still_parts(alone, settings_of, parts.series)
        keys = [own for _, own in lights]
        lit_alone = [
            _lit_part(rest, alone, own, lambda step: None, each.quality) for own, each in zip(keys, lit, strict=True)
        ]
        lit, alpha, shadow = _caught_parts(project, alone, parts, rest, lit, lit_alone)
        whole = _sum(parts.placement.hits, lit)
    picture = with_alpha(light_of(whole), alpha) if background.hides_environment else light_of(whole)
    layers = (
        PictureLayer("direct", "RGB", shown(replace(black, direct=whole.direct, thrown=_only(whole.thrown, 0)))),
        PictureLayer("indirect", "RGB", shown(replace(black, indirect=whole.indirect, thrown=_only(whole.thrown, 1)))),
        PictureLayer("emission", "RGB", shown(replace(black, emission=whole.emission))),
        *_named("light", "RGB", zip((name for name, _ in lights), map(shown, lit), strict=True)),
        *_background_layer(background, alpha),
        *((PictureLayer("shadow", "A", shadow),) if shadow is not None else ()),
        *_data_layers(parts),
        *_named("mask", "A", zip(project.object_names, object_coverage(parts.placement.hits), strict=True)),
        PictureLayer("error", "Y", np.nan_to_num(run_to_end(error_map(parts.placement.hits, errors)))),
    )
    return Still(finished_picture(project.document, picture), errors.estimate, parts.warning, layers)


def _caught_parts(
    project: Project, alone: Project, parts: StillParts, rest: StillParts, lit: Sequence[_LitPart],
    lit_alone: Sequence[_LitPart],
) -> tuple[list[_LitPart], Float64Array, NDArray[np.float32]]:  # fmt: skip
    """What lights add to a picture with the shadows on catchers, its alpha (H, W), and the share (H, W) of what is
    behind that these hide. alone: the project of `without_others`, rest: its parts; lit, lit_alone: what the lights add
    to both pictures."""
    hits, hits_alone = parts.placement.hits, rest.placement.hits
    of_others = ~np.isin(hits.objects, caught_objects(project))[:, None]
    seen, empty = (
        [_required(catcher_part(of, at, light)) for each in own for light in (each.direct, each.indirect)]
        for of, at, own in ((project, hits, lit), (alone, hits_alone, lit_alone))
    )
    others = [_only_points(each, of_others) for each in lit]
    left = _sum(hits, others)
    beside, covered = point_picture(hits, left.direct + left.indirect) + left.emission, 1.0 - hits.open_image
    part, part_alone = _sum_of_parts(seen), _sum_of_parts(empty)
    caught = caught_shadows(with_alpha(beside + part[..., :3], covered), part, part_alone)
    # What is thrown on catchers is shared out by how much more of each light arrives than without other objects.
    thrown, is_caught = np.maximum(caught[..., :3] - beside, 0.0), part[..., 3:] > 0.0
    share = np.where(is_caught, part[..., 3:], 1.0)
    more = np.stack([np.maximum(a[..., :3] / share - empty_light(b), 0.0) for a, b in zip(seen, empty, strict=True)])
    total = more.sum(axis=0)
    shares = np.where(total > 0.0, more / np.where(total > 0.0, total, 1.0), 1.0 / len(more))
    own_thrown = np.where(is_caught, thrown, 0.0) * shares
    shadow = np.clip(caught[..., 3] - (covered - part[..., 3]), 0.0, 1.0).astype(np.float32)
    found = [
        replace(each, emission=each.emission + _sky_behind(project, each.sky, caught[..., 3]), thrown=of_both)
        for each, of_both in zip(others, own_thrown.reshape(len(lit), 2, *thrown.shape), strict=True)
    ]
    return found, caught[..., 3].astype(np.float64), shadow


def _only_points(part: _LitPart, which: NDArray[np.bool_]) -> _LitPart:
    """The part of which only some points (P, 1) reflect."""
    return replace(part, direct=np.where(which, part.direct, 0.0), indirect=np.where(which, part.indirect, 0.0))


def _sky_behind(project: Project, sky: SkyState, alpha: NDArray[np.floating]) -> Float64Array:
    """What is seen of a sky (H, W, 3) behind this alpha (H, W)."""
    nothing = with_alpha(np.zeros((*alpha.shape, 3)), alpha)
    if project.document.background.hides_environment:
        return nothing[..., :3].astype(np.float64)
    return over_sky(nothing, sky, project.scene.description.camera).astype(np.float64)


def _sum_of_parts(parts: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """The sum of the light (H, W, 4) of the same objects under several lights."""
    return with_alpha(np.sum([each[..., :3] for each in parts], axis=0, dtype=np.float64), parts[0][..., 3])


def _required(part: NDArray[np.float32] | None) -> NDArray[np.float32]:
    assert part is not None
    return part


def _only(thrown: Float64Array | None, i: int) -> Float64Array | None:
    """What catchers show of direct light (0) or indirect light (1)."""
    return None if thrown is None else thrown[i : i + 1]


def _background_layer(background: Background, covered: NDArray[np.floating]) -> tuple[PictureLayer, ...]:
    """What a background of one colour adds to the lights; covered (H, W): the share of pixels that hides it."""
    if background.kind != "colour":
        return ()
    seen = (1.0 - covered[..., None]) * np.asarray(background.colour)
    return (PictureLayer("background", "RGB", seen.astype(np.float32)),)


def light_groups(document: Document) -> list[tuple[str, tuple[str, ...]]]:
    """The lights that are on, in groups: the name of each and the keys of its lights; a light in none is one alone.
    Names may be equal: a lamp may be called as a group or a sun is."""
    gains, emission = gains_of(document), dict(emission_of(document))
    groups = dict[str, tuple[str, tuple[str, ...]]]()
    for key in lights_of(document):
        if any(emission.get(key, gains[key])):
            group = document.light.row(key).group
            where, name = (group_key(group), group) if group else (key, key.removeprefix("light."))
            groups[where] = name, (*groups.get(where, (name, ()))[1], key)
    return list(groups.values())


def only_lights(document: Document, keys: Collection[str]) -> Document:
    """The document with all lights off but these, which are as they were, whatever is solo."""
    light = document.light
    groups = {group_key(name) for name in light.groups}
    rows = {
        key: replace(light.row(key), solo=False, on=light.row(key).on and key in (*keys, *groups))
        for key in (*lights_of(document), *groups)
    }
    return replace(document, light=light.with_rows(rows))


def _lit_part(
    parts: StillParts, project: Project, keys: Collection[str], report: Report, quality: Quality | None = None
) -> _LitPart:
    """What these lights add to the picture. quality: see `still_steps`."""
    document = only_lights(project.document, keys)
    sky = sky_of(project.scene, mixed_light(document))
    placement = _with_emission(parts.placement, dict(emission_of(document)))
    if not (placement.scene.emission.any() or sky.environment is not None and sky.environment.radiance.any()):
        return _black(placement.hits)
    indirect, noise = run_to_end(parts.indirect(placement, sky, finds_noise=True), _within(report, 0.0, INDIRECT))
    quality = quality or run_to_end(parts.quality(placement, sky))
    steps = reflect_layers(placement, parts.direct_layers, sky, quality)
    direct = run_to_end(steps, _within(report, INDIRECT, 1.0))
    nothing = np.zeros_like(direct)
    hides_sky = project.document.hides_environment
    emission = compose(placement, nothing, sky, hides_sky)[..., :3].astype(np.float64)
    bounced = nothing if indirect is None else indirect.astype(np.float64)
    return _LitPart(direct, bounced, emission, noise or 0.0, sky, quality)


def _with_emission(placement: Placement, emission: Mapping[str, RGB]) -> Placement:
    """The placement where emitters have this radiance, by name, and are seen with it."""
    lit = placement.with_emission(emission)
    lamps = lit.hits.lamps
    lamps = lamps._replace(emission=lit.scene.emission[lamps.object])
    lit.hits = replace(lit.hits, lamps=lamps, emission_image=emission_picture(lamps, lit.hits.resolution))
    return lit


def _black(hits: PrimaryHits) -> _LitPart:
    """No light."""
    width, height = hits.resolution
    direct, indirect = np.zeros((2, len(hits.pixel), 3))
    return _LitPart(direct, indirect, np.zeros((height, width, 3)), 0.0)


def _sum(hits: PrimaryHits, parts: Iterable[_LitPart]) -> _LitPart:
    """All of the light."""
    total = _black(hits)
    for each in parts:
        thrown = total.thrown if each.thrown is None else each.thrown + (0.0 if total.thrown is None else total.thrown)
        total = _LitPart(
            total.direct + each.direct, total.indirect + each.indirect, total.emission + each.emission,
            math.hypot(total.noise, each.noise), thrown=thrown,
        )  # fmt: skip
    return total


def _estimated_errors(parts: StillParts, sky: SkyState, whole: _LitPart, report: Report) -> PointErrors:
    """The error of the whole picture at some of its points, as finely as `error_map` needs it."""
    placement, n_bounces = parts.placement, parts.series.n_bounces
    indirect, noise = (None, None) if n_bounces == 1 else (whole.indirect, whole.noise)
    quality = run_to_end(parts.quality(placement, sky))
    steps = estimate_point_errors(
        placement, parts.direct_layers, sky, quality, n_bounces, whole.direct + whole.indirect, indirect,
        n_points=MAP_POINTS, noise=noise,
    )  # fmt: skip
    return run_to_end(steps, report)


def _data_layers(parts: StillParts) -> tuple[PictureLayer, ...]:
    surfaces = surface_layers(parts.placement)
    return (
        PictureLayer("albedo", "RGB", albedo_layer(parts.placement.hits, parts.layers)),
        PictureLayer("normal", "XYZ", surfaces.normal),
        PictureLayer("position", "XYZ", surfaces.position),
        PictureLayer("", "Z", surfaces.depth),
    )


def _named(kind: str, letters: str, values: Iterable[tuple[str, NDArray[np.floating]]]) -> Iterator[PictureLayer]:
    """Layers "kind_NAME" whose names differ; what is black is left out."""
    taken = set[str]()
    for name, image in values:
        if image.any():
            plain = f"{kind}_" + re.sub(r"[^\w-]", "_", name)
            numbered = chain([plain], (f"{plain}_{number}" for number in count(2)))
            free = next(each for each in numbered if each not in taken)
            taken.add(free)
            yield PictureLayer(free, letters, image)


def _within(report: Report, begin: float, end: float, text: str = "") -> Report:
    """Reports the progress of a part of the work, from one fraction of the whole to another."""
    before = f"{text}: " if text else ""
    return lambda step: report(StillProgress(begin + (end - begin) * step.fraction, before + step.text))
