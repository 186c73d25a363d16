"""A metallic-roughness material and its extensions as layers [glTF20, B; KHR_materials_specular, _clearcoat, _sheen].

With base colour b(u, v), metalness m, the dielectric's F0 = f, specular strength w, r = (1 - cos theta_d)^5 and the
microfacets' D G / (4 cos cos) = S, the specification's sum is

    (1 - m) [(1 - w max(f + (1 - f) r)) b / pi + w (f + (1 - f) r) S] + m [b + (1 - b) r] S,

and linear in b and in w, so that an image of either multiplies a layer: without images there are a diffuse base and one
gloss with F0 = (1 - m) w f + m b and F90 = (1 - m) w + m; where b of a metal is an image, the metal's b (1 - r) S is a
layer of its own; where f is one, so is its f (1 - r) S.

A gloss that is a streak (KHR_materials_anisotropy) is of `brushed` in place of `microfacet`; an image of its strength
is a map of that.

Where m is an image, the sum is in these two parts, for m = 0 and for m = 1, each with its share as the map of its
strength [engine.material.parameter_maps]; an image of the roughness is the map of all widths, its square.

A coat or a sheen takes the share c(u, v) E(theta_o) from all beneath (`Layer.under`). Where c is an image, each layer
beneath is two: 1 - c of it bare and c of it covered, with shared curves. In the same way the base under an image of f
or of w is two layers, or three: one without gloss on it, one whose gloss has no f. Shares multiply: the first image of
a layer is its weight map, others are further ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from engine.material.bumps import Bumps
from engine.material.layer_maps import ChannelImage, FurtherWeight, LayerMaps
from engine.scene.description import LayerDescription

RGB = tuple[float, float, float]
Layers = tuple[LayerDescription, ...]
DIELECTRIC = 0.04
WHITE: RGB = (1.0, 1.0, 1.0)
BLACK: RGB = (0.0, 0.0, 0.0)
SMOOTHEST = 0.01  # the least α: a mirror is kept just rough enough to be sampled
LEAST_SHEEN = 0.01
COAT = "coat"  # the name of the layer
_BRIGHTEST = 0.999  # F0 of the gloss on a base: more leaves nothing of it
_MIXED = 0.02  # metalness this close to 0 or 1 counts as that


@dataclass(frozen=True)
class NumberImage:
    """An image whose channel multiplies a number, in its mapping: the keys of a parameter map but for its range."""

    keys: Mapping[str, object]

    def table(self, low: object, high: object, **more: object) -> dict[str, object]:
        """The table of a parameter that goes from low, at black, to high."""
        return {**self.keys, "range": (low, high), **more}


@dataclass(frozen=True)
class Coat:
    """A clear coat: its strength and roughness in [0, 1], its index of refraction, and the images of the first two."""

    strength: float
    roughness: float = 0.0
    ior: float = 1.5
    image: ChannelImage | None = None
    roughness_image: NumberImage | None = None


@dataclass(frozen=True)
class SheenCoat:
    """A sheen: its colour and roughness in [0, 1], the image of its colour, that of the largest of its channels, and
    that of its roughness."""

    colour: RGB
    roughness: float = 0.0
    texture: LayerMaps = LayerMaps()
    image: ChannelImage | None = None
    roughness_image: NumberImage | None = None


@dataclass(frozen=True)
class Film:
    """A thin film: its strength in [0, 1], index of refraction and thickness in nm; the image of its strength, and that
    of its thickness, which goes from `thinnest`, at black, to the thickness."""

    strength: float
    ior: float = 1.3
    thickness: float = 400.0
    image: ChannelImage | None = None
    thickness_image: NumberImage | None = None
    thinnest: float = 0.0


@dataclass(frozen=True)
class PbrMaterial:
    """base: linear colour; metallic, roughness, anisotropy in [0, 1]; facing: F0 of the dielectric part, at most 1,
    before its strength `specular`. Images that multiply base and facing, the largest channel of the latter, the
    strength, and the three numbers; that of the roughness goes from `roughness_at_black` to the roughness."""

    base: RGB = WHITE
    metallic: float = 1.0
    roughness: float = 1.0
    base_texture: LayerMaps = LayerMaps()
    facing: RGB = (DIELECTRIC,) * 3
    specular: float = 1.0
    facing_texture: LayerMaps = LayerMaps()
    facing_image: ChannelImage | None = None
    specular_image: ChannelImage | None = None
    metallic_image: NumberImage | None = None
    roughness_image: NumberImage | None = None
    roughness_at_black: float = 0.0
    anisotropy: float = 0.0
    anisotropy_image: NumberImage | None = None
    film: Film | None = None
    sheen: SheenCoat | None = None
    coat: Coat | None = None


def pbr_layers(material: PbrMaterial) -> Layers:
    """The layers of a material, what lies beneath first."""
    metallic = material.metallic
    metallic = 0.0 if metallic < _MIXED else 1.0 if metallic > 1.0 - _MIXED else metallic
    image = material.metallic_image
    if image is None or metallic == 0.0:
        layers = _bare(material, metallic)
    else:
        dielectric = (_with_strength(each, image, 1.0, 1.0 - metallic) for each in _bare(material, 0.0))
        metal = (_with_strength(each, image, 0.0, metallic) for each in map(_of_metal, _bare(material, 1.0)))
        layers = (*dielectric, *metal)
    if material.roughness_image is not None:
        ends = material.roughness_at_black, material.roughness
        layers = tuple(
            _with_widths(each, material.roughness_image, *ends) if "alpha" in each.parameters else each
            for each in layers
        )
    if material.sheen is not None and any(material.sheen.colour):
        layers = _covered(layers, _sheen(material.sheen), material.sheen.image)
    if material.coat is not None and material.coat.strength > 0.0:
        layers = _covered(layers, _coat(material.coat), material.coat.image)
    return layers


def with_coat_frame(layers: Layers, bumps: Bumps) -> Layers:
    """The layers of a material with such bumps; where there are any, the coat reflects in a frame of its own: in all
    formats that have a coat's normal it is the smooth surface's where it is not given."""
    if not (bumps.file or bumps.coat_normal_map):
        return layers
    return tuple(each.model_copy(update={"frame": "coat"}) if each.name == COAT else each for each in layers)


def _with_widths(
    layer: LayerDescription, image: NumberImage | None, at_black: float, at_white: float, least: float = SMOOTHEST
) -> LayerDescription:
    """A layer whose alpha is the square of a roughness that follows an image, if there is one."""
    if image is None:
        return layer
    return _with_map(layer, "alpha", image.table(at_black**2, at_white**2, response="square", least=least))


def _bare(material: PbrMaterial, metallic: float) -> Layers:
    """The layers beneath sheen and coat, for one metalness."""
    if material.film is None:
        return (*_diffuse(material, metallic), *_gloss(material, metallic))
    return _iridescent(material, metallic, material.film)


def _of_metal(layer: LayerDescription) -> LayerDescription:
    """A layer under a name that none of the dielectric part has."""
    name = "metal" if layer.name == "metal" else f"metal {layer.name}"
    return layer.model_copy(update={"name": name, "follows": layer.follows and f"metal {layer.follows}"})


def _with_strength(layer: LayerDescription, image: NumberImage, low: float, high: float) -> LayerDescription:
    """A layer whose strength goes from low, at black, to high times its own."""
    name = "albedo" if "albedo" in layer.parameters else "scale"
    own = layer.parameters.get(name, WHITE)
    return _with_map(layer, name, image.table(_scaled(own, low), _scaled(own, high)))


def _with_map(layer: LayerDescription, name: str, table: dict[str, object]) -> LayerDescription:
    return layer.model_copy(update={"parameter_maps": {**layer.parameter_maps, name: table}})


def _diffuse(material: PbrMaterial, metallic: float) -> list[LayerDescription]:
    """(1 - m) (1 - max F) b / pi with F = w (f + (1 - f) r). Where w is an image, this is the base without F by 1 - w,
    and with it by w; where f is one, its part under w is the base with f = 0 by 1 - f, and with it by f."""
    albedo, w = _scaled(material.base, 1.0 - metallic), material.specular
    if not any(albedo):
        return []

    def base(name: str, facing: RGB, f90: float, maps: LayerMaps, follows: str | None = None) -> LayerDescription:
        parameters = {"albedo": albedo, "f0": facing, "f90": f90}
        return LayerDescription(model="diffuse_base", name=name, follows=follows, maps=maps, parameters=parameters)

    facing, maps, found = _scaled(material.facing, w), material.base_texture, list[LayerDescription]()
    if material.specular_image is not None:
        found.append(base("bare base", BLACK, 0.0, _weighted(maps, material.specular_image, inverted=True)))
        maps = _weighted(maps, material.specular_image)
    if material.facing_image is not None:
        found.append(base("dull base", BLACK, w, _weighted(maps, material.facing_image, inverted=True)))
        maps = _weighted(maps, material.facing_image)
        if min(max(facing), w) > _BRIGHTEST:
            return found
    shares_gloss = metallic == 0.0 and not found
    return [base("base", facing, w, maps, "gloss" if shares_gloss else None), *found]


def _gloss(material: PbrMaterial, metallic: float) -> list[LayerDescription]:
    """The layers of microfacets; see the module."""
    alpha, w = max(material.roughness**2, SMOOTHEST), material.specular * (1.0 - metallic)

    def layer(name: str, f0: RGB, f90: float, maps: LayerMaps, scale: RGB = WHITE) -> LayerDescription:
        parameters = {"alpha": alpha, "f0": f0, "f90": f90, "scale": scale}
        if not material.anisotropy:
            return LayerDescription(model="microfacet", name=name, maps=maps, parameters=parameters)
        parameters |= {"anisotropy": material.anisotropy}
        streak = LayerDescription(model="brushed", name=name, maps=maps, parameters=parameters)
        if material.anisotropy_image is None:
            return streak
        return _with_map(streak, "anisotropy", material.anisotropy_image.table(0.0, material.anisotropy))

    plain, image = LayerMaps(), material.specular_image
    weights = plain if image is None else _weighted(plain, image)
    metal = _scaled(material.base, metallic)
    is_painted = metallic > 0.0 and not material.base_texture.is_plain
    found = []
    if material.facing_texture.is_plain:
        dielectric, rim = _scaled(material.facing, w), w
    else:
        facing_maps = material.facing_texture if image is None else _weighted(material.facing_texture, image)
        found.append(layer("facing gloss", WHITE, 0.0, facing_maps, _scaled(material.facing, w)))
        dielectric, rim = BLACK, w
    if image is None:
        f0 = dielectric if is_painted else _sum(dielectric, metal)
        found.append(layer("gloss", f0, rim + metallic, plain))
    else:
        if w > 0.0:
            found.append(layer("gloss", dielectric, rim, weights))
        if metallic > 0.0:
            f0 = BLACK if is_painted else metal
            found.append(layer("rim" if is_painted else "metal", f0, metallic, plain))
    if is_painted:
        found.append(layer("metal", WHITE, 0.0, material.base_texture, metal))
    return found


def _iridescent(material: PbrMaterial, metallic: float, film: Film) -> Layers:
    """Base, dielectric and metal under a film, whose curve is linear in neither: they are layers of their own. A
    texture of the metal multiplies the film's colours; images of the dielectric's F0 and strength count as white."""
    alpha, w = max(material.roughness**2, SMOOTHEST), material.specular
    facing = _scaled(material.facing, w)

    def layers(film_share: float, bare: bool = False) -> Layers:
        shown = {"film": film_share, "film_ior": film.ior, "thickness": film.thickness}
        image = None if bare else film.thickness_image
        mapped = {} if image is None else {"thickness": image.table(film.thinnest, film.thickness)}

        def layer(
            model: str, name: str, maps: LayerMaps, follows: str | None = None, **own: object
        ) -> LayerDescription:
            if bare:
                name, follows = f"bare {name}", follows and f"bare {follows}"
            maps = maps if film.image is None else _weighted(maps, film.image, bare)
            return LayerDescription(
                model=model, name=name, follows=follows, maps=maps, parameters={**own, **shown}, parameter_maps=mapped
            )

        found, texture, plain = [], material.base_texture, LayerMaps()
        if metallic < 1.0:
            albedo, share = _scaled(material.base, 1.0 - metallic), _scaled(WHITE, 1.0 - metallic)
            found.append(layer("thin_film_base", "base", texture, "gloss", albedo=albedo, f0=facing, f90=w))
            found.append(layer("thin_film", "gloss", plain, alpha=alpha, f0=facing, f90=w, scale=share))
        if metallic > 0.0:
            share = _scaled(WHITE, metallic)
            found.append(layer("thin_film", "metal", texture, alpha=alpha, f0=material.base, f90=1.0, scale=share))
        return tuple(found)

    return layers(film.strength) if film.image is None else (*layers(film.strength), *layers(0.0, bare=True))


def _sheen(sheen: SheenCoat) -> LayerDescription:
    parameters = {"alpha": max(sheen.roughness**2, LEAST_SHEEN), "scale": sheen.colour}
    layer = LayerDescription(model="sheen", name="sheen", maps=sheen.texture, parameters=parameters)
    return _with_widths(layer, sheen.roughness_image, 0.0, sheen.roughness, LEAST_SHEEN)


def _coat(coat: Coat) -> LayerDescription:
    maps = LayerMaps() if coat.image is None else _weighted(LayerMaps(), coat.image)
    parameters = {"alpha": max(coat.roughness**2, SMOOTHEST), "ior": coat.ior, "scale": coat.strength}
    layer = LayerDescription(model="clearcoat", name=COAT, maps=maps, parameters=parameters)
    return _with_widths(layer, coat.roughness_image, 0.0, coat.roughness)


def _covered(layers: Iterable[LayerDescription], cover: LayerDescription, image: ChannelImage | None) -> Layers:
    """The layers beneath a cover, and the cover. Where the cover's share is an image, each layer is two."""
    found: list[LayerDescription] = []
    for layer in layers:
        beneath = layer if layer.under else layer.model_copy(update={"under": cover.name})
        if image is None:
            found.append(beneath)
            continue
        bare = layer.model_copy(
            update={
                "name": f"{layer.name} without {cover.name}", "follows": layer.follows or layer.name,
                "under": f"{layer.under} without {cover.name}" if layer.under else None,
                "maps": _weighted(layer.maps, image, inverted=True),
            }
        )  # fmt: skip
        found += [beneath.model_copy(update={"maps": _weighted(layer.maps, image)}), bare]
    return (*found, cover)


def _weighted(maps: LayerMaps, image: ChannelImage, inverted: bool = False) -> LayerMaps:
    """The maps with an image as a weight more, or with one minus it. The weight map, which can be painted, lies in
    plain coordinates."""
    if maps.weight or image.mapping != ChannelImage("").mapping:
        return replace(maps, further_weights=(*maps.further_weights, FurtherWeight(image, inverted)))
    return replace(maps, weight=image.file, weight_channel=image.channel, weight_invert=inverted)


def _scaled(colour: RGB, factor: float) -> RGB:
    red, green, blue = colour
    return red * factor, green * factor, blue * factor


def _sum(one: RGB, other: RGB) -> RGB:
    red, green, blue = (a + b for a, b in zip(one, other, strict=True))
    return red, green, blue
