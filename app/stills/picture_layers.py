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
afterwards. Of shadow catchers layers have the light that they would show themselves. Rejected: light by light from the
samples of one solution, whose glossy second bounces are those of all lights together.

Names are `layer.channel`, which Nuke and Blender show as layers; Blender's depth is Z as well. In names of objects
and lights, what is no letter, digit or "-" is "_": a dot would begin another layer. The second of equal names has _2.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
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
from app.stills.shadow_catcher import catcher_part, caught_shadows, over_sky, without_others
from app.stills.stills import (
    Report,
    Still,
    StillParts,
    draw_still,
    finished_picture,
    still_parts,
    still_settings,
    with_intensity,
)
from engine.core.generators import StillProgress, run_to_end
from engine.precompute.direct.pipeline import Placement, SkyState
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
    what is seen of them; noise: RMS radiance of that in the indirect light."""

    direct: Float64Array
    indirect: Float64Array
    emission: Float64Array
    noise: float


def render_layers(project: Project, report: Report, *, series: BounceSeries | None = None, **settings: Any) -> Still:
    """A still of a project in Placement with its layers; arguments: see `render_project`."""
    parts = still_parts(project, still_settings(project, "placement", settings), series)
    lights = light_groups(project.document)
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
        return point_picture(parts.placement.hits, part.direct + part.indirect) + part.emission

    black, background = _black(parts.placement.hits), project.document.background
    covered = 1.0 - parts.placement.hits.open_image
    picture = with_alpha(light_of(whole), covered) if background.hides_environment else light_of(whole)
    alone, shadow = without_others(project), None
    if alone is not None:
        picture, shadow = _with_caught_shadows(project, alone, parts, light_of(whole), whole)
    layers = (
        PictureLayer("direct", "RGB", shown(replace(black, direct=whole.direct))),
        PictureLayer("indirect", "RGB", shown(replace(black, indirect=whole.indirect))),
        PictureLayer("emission", "RGB", shown(replace(black, emission=whole.emission))),
        *_named("light", "RGB", zip((name for name, _ in lights), map(shown, lit), strict=True)),
        *_background_layer(background, covered if shadow is None else picture[..., 3]),
        *((PictureLayer("shadow", "A", shadow),) if shadow is not None else ()),
        *_data_layers(parts),
        *_named("mask", "A", zip(project.object_names, object_coverage(parts.placement.hits), strict=True)),
        PictureLayer("error", "Y", np.nan_to_num(run_to_end(error_map(parts.placement.hits, errors)))),
    )
    return Still(finished_picture(project.document, picture), errors.estimate, parts.warning, layers)


def _with_caught_shadows(
    project: Project, alone: Project, parts: StillParts, light: Float64Array, whole: _LitPart
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A picture of this light (H, W, 3) with the shadows on catchers, as `with_caught_shadows` returns it, and the
    share (H, W) of what is behind that they hide. alone: the project of `without_others`; whole: all light."""
    hits, sky, background = parts.placement.hits, project.sky, project.document.background
    if not background.hides_environment:  # what is seen of it is in the light
        nothing = np.zeros((len(hits.pixel), 3))
        light = light - (compose(parts.placement, nothing, sky) - compose(parts.placement, nothing, sky, True)[..., :3])
    covered = 1.0 - hits.open_image
    quality = run_to_end(parts.quality(parts.placement, sky))
    rest = draw_still(alone, lambda step: None, series=parts.series, quality=quality).catchers
    part = catcher_part(project, hits, whole.direct + whole.indirect)
    assert part is not None and rest is not None
    picture = caught_shadows(with_alpha(light, covered), part, rest)
    shadow = np.clip(picture[..., 3] - (covered - part[..., 3]), 0.0, 1.0).astype(np.float32)
    camera = project.scene.description.camera
    return picture if background.hides_environment else over_sky(picture, sky, camera), shadow


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


def _lit_part(parts: StillParts, project: Project, keys: Collection[str], report: Report) -> _LitPart:
    """What these lights add to the picture."""
    document = only_lights(project.document, keys)
    sky = sky_of(project.scene, mixed_light(document))
    placement = _with_emission(parts.placement, dict(emission_of(document)))
    if not (placement.scene.emission.any() or sky.environment is not None and sky.environment.radiance.any()):
        return _black(placement.hits)
    indirect, noise = run_to_end(parts.indirect(placement, sky, finds_noise=True), _within(report, 0.0, INDIRECT))
    steps = reflect_layers(placement, parts.direct_layers, sky, run_to_end(parts.quality(placement, sky)))
    direct = run_to_end(steps, _within(report, INDIRECT, 1.0))
    nothing = np.zeros_like(direct)
    hides_sky = project.document.background.hides_environment
    emission = compose(placement, nothing, sky, hides_sky)[..., :3].astype(np.float64)
    return _LitPart(direct, nothing if indirect is None else indirect.astype(np.float64), emission, noise or 0.0)


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
        total = _LitPart(
            total.direct + each.direct, total.indirect + each.indirect, total.emission + each.emission,
            math.hypot(total.noise, each.noise),
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
