"""gltf_pbr as glTF's material (`engine.scene.loaders.pbr_layers`), and UsdPreviewSurface as a stack of layers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from engine.material.bumps import NO_BUMPS, Bumps
from engine.material.layer_maps import ChannelImage, LayerMaps, TextureTransform
from engine.material.opacity import OPAQUE
from engine.material.parameters import reflectance_of_index
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Field, combine
from engine.scene.loaders.layer_stack import ONE, StackedLayer, covered, layer_descriptions
from engine.scene.loaders.pbr_layers import (
    Coat,
    Film,
    NumberImage,
    PbrMaterial,
    SheenCoat,
    pbr_layers,
    with_coat_frame,
)
from engine.scene.loaders.surface_inputs import (
    RGB,
    Float64Array,
    SurfaceInputs,
    mean_of,
    mixed,
    one_minus,
    plain,
    product,
    rgb_of,
)
from engine.scene.loaders.surface_parts import (
    SurfaceMaterial,
    blended,
    bumps_of,
    bumps_of_colours,
    conductor,
    emission_of,
    is_everywhere,
    schlick_gloss,
)


def read_gltf_pbr(inputs: SurfaceInputs, maps: MapMaker) -> SurfaceMaterial:
    colour, texture = _coloured(inputs.field("base_color"), maps)
    metallic, metallic_image = _numbered(inputs.field("metallic"), maps)
    roughness, roughness_image = _numbered(inputs.field("roughness"), maps)
    inputs.field("occlusion")  # has no effect: shadows are computed
    facing = reflectance_of_index(inputs.number("ior", 1.0, 20.0))
    tint, tint_texture = _coloured(inputs.field("specular_color"), maps)
    specular, specular_image = _shared(inputs.field("specular"), maps)
    film_weight, film_image = _shared(inputs.field("iridescence"), maps)
    film = Film(
        film_weight, inputs.number("iridescence_ior", 1.0, 5.0), inputs.number("iridescence_thickness", 0.0, 5000.0),
        film_image,
    )  # fmt: skip
    sheen_colour, sheen_texture = _coloured(inputs.field("sheen_color"), maps)
    sheen_roughness, sheen_image = _numbered(inputs.field("sheen_roughness"), maps)
    sheen = SheenCoat(sheen_colour, sheen_roughness, sheen_texture, _largest(sheen_texture), sheen_image)
    coat_weight, coat_image = _shared(inputs.field("clearcoat"), maps)
    coat_roughness, coat_blur = _numbered(inputs.field("clearcoat_roughness"), maps)
    coat = Coat(coat_weight, coat_roughness, 1.5, coat_image, coat_blur)
    red, green, blue = (min(float(facing) * each, 1.0) for each in tint)  # type: ignore[arg-type]
    streak, streak_image = 0.0, None
    if not film.strength:
        streak, streak_image = _numbered(inputs.field("anisotropy_strength"), maps)
    material = PbrMaterial(
        colour, metallic, roughness, texture, (red, green, blue), specular, tint_texture, _largest(tint_texture),
        specular_image, metallic_image, roughness_image, film=film if film.strength > 0.0 else None, sheen=sheen,
        coat=coat, anisotropy=streak, anisotropy_image=streak_image,
    )  # fmt: skip
    emitted = emission_of(inputs.field("emissive"), maps, inputs.field("emissive_strength"))
    alpha, mode = inputs.field("alpha"), int(inputs.number("alpha_mode", 0.0, 2.0))
    cutoff = inputs.number("alpha_cutoff")
    opacity = OPAQUE if mode == 0 else blended(alpha, maps, ("mask" if mode == 1 else "blend"), cutoff)
    bumps = bumps_of(inputs, "normal", maps)
    if streak:
        turn = math.degrees(inputs.number("anisotropy_rotation", -math.tau, math.tau))
        bumps = replace(bumps, tangent_along_u=True, tangent_angle=turn)
    if coat.strength > 0.0:
        bumps = bumps.with_coat(bumps_of(inputs, "clearcoat_normal", maps))
    return SurfaceMaterial(with_coat_frame(pbr_layers(material), bumps), emitted, bumps, opacity)


def read_preview_surface(inputs: SurfaceInputs, maps: MapMaker) -> SurfaceMaterial:
    """UsdPreviewSurface as MaterialX builds it: a coat on a gloss on the base, mixed with a metal. With
    t = 1 + m (c − 1) of metalness m and colour c, the gloss has t (φ + (1 − φ) r), r = (1 − cos)^5, where φ goes from
    the index's F0 to 1; with the specular workflow F0 is a colour."""
    colour, roughness = inputs.field("diffuseColor"), inputs.field("roughness")
    inputs.field("occlusion")  # has no effect: shadows are computed
    own = float(reflectance_of_index(inputs.number("ior", 1.0, 20.0)))  # type: ignore[arg-type]
    metallic, reflected = inputs.field("metallic"), inputs.field("specularColor")
    base = [StackedLayer("base", "lambert", colour)]
    if inputs.number("useSpecularWorkflow") > 0.5:
        facing = rgb_of(mean_of(reflected))
        tint = ONE
        if not reflected.is_constant:
            inputs.list("specularColor", "its image tints the gloss at its edge, too; the base loses the mean")
            tint = combine(lambda each: each / np.maximum(facing, 1e-6), reflected)
        layers = schlick_gloss(base, ONE, roughness, facing, tint)
    else:
        rest = one_minus(metallic)
        base = [replace(base[0], strength=product(colour, rest))]
        phi, tint = own, ONE
        if metallic.is_constant:
            phi, tint = own + (1.0 - own) * float(metallic.value[0]), mixed(ONE, colour, metallic)
        else:
            inputs.list("metallic", "between 0 and 1 its gloss is that of 0")
        layers = schlick_gloss(base, rest, roughness, np.full(3, phi), tint)
        if not is_everywhere(metallic, 0.0):
            layers += conductor(colour, colour, metallic, roughness, None)
    coat = inputs.field("clearcoat")
    if not is_everywhere(coat, 0.0):
        facets = {"f0": (own,) * 3, "f90": 1.0}
        blur = inputs.field("clearcoatRoughness")
        layers = covered(layers, StackedLayer("coat", "schlick_varnish", roughness=blur, parameters=facets), coat)
    threshold = inputs.number("opacityThreshold")
    opacity = blended(inputs.field("opacity"), maps, "mask" if threshold > 0.0 else "blend", threshold or 0.5)
    emission = emission_of(inputs.field("emissiveColor"), maps)
    return SurfaceMaterial(layer_descriptions(layers, maps), emission, _preview_bumps(inputs, maps), opacity)


def _preview_bumps(inputs: SurfaceInputs, maps: MapMaker) -> Bumps:
    """The normal map of directions in the surface's own frame."""
    directions = inputs.field("normal")
    if directions.is_constant:
        if not np.allclose(directions.value, (0.0, 0.0, 1.0)):
            inputs.list("normal", "one direction for all is that of the surface")
        return NO_BUMPS
    return bumps_of_colours(combine(lambda each: 0.5 + 0.5 * each, directions), 1.0, maps)


def _coloured(colours: Field, maps: MapMaker) -> tuple[RGB, LayerMaps]:
    """Colours as a factor, at most 1, and a texture."""
    factor, varying = colours.parts
    if varying is None:
        return _rgb(factor), LayerMaps()
    if (factor > 1.0).any():
        factor, varying = np.ones(1), colours
    return _rgb(factor), maps.colours(varying)


def _rgb(values: Float64Array) -> RGB:
    red, green, blue = np.clip(rgb_of(values), 0.0, 1.0).tolist()
    return plain(red), plain(green), plain(blue)


def _numbered(numbers: Field, maps: MapMaker) -> tuple[float, NumberImage | None]:
    """A number, or 1 and the image that multiplies it."""
    if numbers.is_constant:
        return plain(float(np.clip(numbers.value[0], 0.0, 1.0))), None
    return 1.0, maps.numbers(numbers)


def _shared(numbers: Field, maps: MapMaker) -> tuple[float, ChannelImage | None]:
    """A share, or 1 and the image of it."""
    if numbers.is_constant:
        return plain(float(np.clip(numbers.value[0], 0.0, 1.0))), None
    return 1.0, maps.share(numbers)


def _largest(texture: LayerMaps) -> ChannelImage | None:
    """The largest channel of a texture."""
    if not texture.texture:
        return None
    transform = TextureTransform(texture.texture_rotation, texture.texture_offset, texture.texture_wrap)
    return ChannelImage(texture.texture, "max", texture.texture_scale, transform)
