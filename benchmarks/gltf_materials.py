"""What glTF's materials look like here, against paths whose BRDF is the specification's own formula, at full resolution
of the textures: `python -m benchmarks.gltf_materials MUSEUM.exr [--side PIXELS] [CASE ...]` prints the table of
docs/guides/materials.md.

Each case is a GLB file that is read as any other: a sphere with factors alone, and a quad with a texture of each
colour, strength and roughness, seen obliquely, under an environment and under a lamp. The judge
(`engine.reference.gltf_brdf`) gets factors and textures, not layers; its picture of the quad has 3 x 3 rays a pixel.
Columns: the error without the judge's noise, and in brackets that of the mean with its standard error; the noise.
"""

from __future__ import annotations

import argparse
import io
import json
import shutil
import struct
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.measure.subject import CLAMP_PERCENTILE, Errors, box_averaged, errors
from app.project.project import Project, open_project
from app.stills.stills import render_picture
from engine.core.generators import run_to_end
from engine.material import MODELS, kinds, make_layer
from engine.material.layer import Layer
from engine.material.layer_maps import Channel, LayerMaps
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.reference.gltf_brdf import GltfInputs, gltf_reflection
from engine.reference.path_lobes import Scattering
from engine.reference.path_tracer import trace_paths
from engine.scene.primitives import quad, sphere

FINER = 3  # rays of the judge along each side of a pixel of the quad
SIDE = 32
N_SAMPLES = {"sphere": 1024, "quad": 128}  # of the judge at 32 x 32; fewer at larger sizes, for as many paths in all


class Texture(NamedTuple):
    """A channel of a texture of a case: the input that it multiplies, and the channel, None for all colours; black: the
    input where it is black."""

    name: str
    channel: Channel | None = None
    black: float = 0.0


@dataclass(frozen=True)
class Case:
    """material: of the file, without textures; inputs: what the judge makes of the factors; textures: by the place of
    their key in the file, such as "pbrMetallicRoughness.baseColorTexture", their channels; normals: the keys of normal
    maps, waves that both shapes have."""

    material: Mapping[str, Any]
    inputs: GltfInputs
    textures: Mapping[str, Sequence[Texture]] = field(default_factory=dict)
    normals: tuple[str, ...] = ()

    @property
    def channels(self) -> list[tuple[int, Texture]]:
        """The number of a texture and each of its channels."""
        return [(k, channel) for k, channels in enumerate(self.textures.values()) for channel in channels]


def _material(metallic: float = 0.0, roughness: float = 0.4, **extensions: Mapping[str, Any]) -> dict[str, Any]:
    pbr = {"baseColorFactor": [0.7, 0.4, 0.2, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    return {
        "pbrMetallicRoughness": pbr,
        "extensions": {f"KHR_materials_{name}": values for name, values in extensions.items()},
    }


_INPUTS = GltfInputs(base_color=(0.7, 0.4, 0.2), roughness=0.4)
_BASE = {"pbrMetallicRoughness.baseColorTexture": (Texture("base_color"),)}
_COAT, _SHEEN, _FILM, _OLD = (
    f"extensions.KHR_materials_{name}"
    for name in ("clearcoat", "sheen", "iridescence", "pbrSpecularGlossiness")
)  # fmt: skip
CASES: Mapping[str, Case] = {
    "core, plastic": Case(_material(), _INPUTS, _BASE),
    "core, metal": Case(_material(1.0), replace(_INPUTS, metallic=1.0), _BASE),
    "core, half a metal": Case(_material(0.5), replace(_INPUTS, metallic=0.5), _BASE),
    "clearcoat": Case(
        _material(0.0, 0.8, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.3}),
        replace(_INPUTS, roughness=0.8, clearcoat=1.0, clearcoat_roughness=0.3),
        {**_BASE, f"{_COAT}.clearcoatTexture": (Texture("clearcoat", "r"),)},
    ),
    "clearcoat, its normals": Case(
        _material(0.0, 0.5, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.3}),
        replace(_INPUTS, roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.3),
        _BASE, (f"{_COAT}.clearcoatNormalTexture",),
    ),
    "clearcoat, base's normals": Case(
        _material(0.0, 0.5, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.3}),
        replace(_INPUTS, roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.3), _BASE, ("normalTexture",),
    ),
    "sheen": Case(
        _material(0.0, 0.8, sheen={"sheenColorFactor": [0.8, 0.8, 0.8], "sheenRoughnessFactor": 0.5}),
        replace(_INPUTS, roughness=0.8, sheen_color=(0.8, 0.8, 0.8), sheen_roughness=0.5),
        {**_BASE, f"{_SHEEN}.sheenColorTexture": (Texture("sheen_color"),)},
    ),
    "specular": Case(
        _material(0.0, 0.3, specular={"specularFactor": 0.8, "specularColorFactor": [1.0, 0.6, 0.3]}),
        replace(_INPUTS, roughness=0.3, specular=0.8, specular_color=(1.0, 0.6, 0.3)),
        {**_BASE, "extensions.KHR_materials_specular.specularTexture": (Texture("specular", "a"),)},
    ),
    "specular colour, ior": Case(
        _material(0.0, 0.3, specular={"specularColorFactor": [1.0, 1.0, 1.0]}, ior={"ior": 2.4}),
        replace(_INPUTS, roughness=0.3, ior=2.4),
        {**_BASE, "extensions.KHR_materials_specular.specularColorTexture": (Texture("specular_color"),)},
    ),
    "iridescence, plastic": Case(
        _material(0.0, 0.3, iridescence={"iridescenceFactor": 1.0, "iridescenceThicknessMaximum": 450.0}),
        replace(_INPUTS, roughness=0.3, iridescence=1.0, iridescence_thickness=450.0),
        {**_BASE, f"{_FILM}.iridescenceTexture": (Texture("iridescence", "r"),)},
    ),
    "iridescence, metal": Case(
        _material(1.0, 0.3, iridescence={"iridescenceFactor": 0.8, "iridescenceIor": 1.8}),
        replace(_INPUTS, metallic=1.0, roughness=0.3, iridescence=0.8, iridescence_ior=1.8),
        {f"{_FILM}.iridescenceTexture": (Texture("iridescence", "r"),)},
    ),
    "anisotropy": Case(
        _material(1.0, 0.4, anisotropy={"anisotropyStrength": 0.8}),
        replace(_INPUTS, metallic=1.0, anisotropy=0.8),
        {**_BASE, "extensions.KHR_materials_anisotropy.anisotropyTexture": (Texture("anisotropy", "b"),)},
    ),
    "specular-glossiness": Case(
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0.5, 0.3, 0.2, 1.0], "specularFactor": [0.6, 0.6, 0.6], "glossinessFactor": 0.6,
        }}},
        GltfInputs(base_color=(0.5, 0.3, 0.2), roughness=0.4, ior=0.0, specular_color=(0.6, 0.6, 0.6)),
        {f"{_OLD}.diffuseTexture": (Texture("base_color"),),
         f"{_OLD}.specularGlossinessTexture": (Texture("specular_color"), Texture("roughness", "a", 1.0))},
    ),
    "roughness, metalness": Case(
        _material(1.0, 0.9), replace(_INPUTS, metallic=1.0, roughness=0.9),
        {"pbrMetallicRoughness.metallicRoughnessTexture": (Texture("roughness", "g"), Texture("metallic", "b"))},
    ),
    "clearcoat roughness": Case(
        _material(0.0, 0.8, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.6}),
        replace(_INPUTS, roughness=0.8, clearcoat=1.0, clearcoat_roughness=0.6),
        {**_BASE, f"{_COAT}.clearcoatRoughnessTexture": (Texture("clearcoat_roughness", "g"),)},
    ),
    "sheen roughness": Case(
        _material(0.0, 0.8, sheen={"sheenColorFactor": [0.8, 0.8, 0.8], "sheenRoughnessFactor": 0.9}),
        replace(_INPUTS, roughness=0.8, sheen_color=(0.8, 0.8, 0.8), sheen_roughness=0.9),
        {**_BASE, f"{_SHEEN}.sheenRoughnessTexture": (Texture("sheen_roughness", "a"),)},
    ),
    "film thickness": Case(
        _material(1.0, 0.3, iridescence={
            "iridescenceFactor": 0.8, "iridescenceThicknessMinimum": 200.0, "iridescenceThicknessMaximum": 500.0,
        }),
        replace(_INPUTS, metallic=1.0, roughness=0.3, iridescence=0.8, iridescence_thickness=500.0),
        {f"{_FILM}.iridescenceThicknessTexture": (Texture("iridescence_thickness", "g", 200.0),)},
    ),
}  # fmt: skip
LIGHTS = ("environment", "lamp")


class AuthoredScattering(Scattering):
    """The judge's BRDF. Of the layers the first ones have the textures, one each; sampling follows the others."""

    def __init__(self, layers: Sequence[Layer], case: Case, n_textures: int) -> None:
        super().__init__(layers[n_textures:])
        self._inputs, self._channels = case.inputs, [channel for _, channel in case.channels][:n_textures]

    def evaluate(
        self, wi: NDArray[np.float64], wo: NDArray[np.float64], factors: NDArray[np.floating] | None = None,
        texels: NDArray[np.float64] | None = None, to_coat: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
        value, pdf = super().evaluate(wi, wo, to_coat=to_coat)
        values = dict[str, Any]()
        for k, (name, _, black) in enumerate(self._channels):
            assert factors is not None
            factor = np.asarray(getattr(self._inputs, name))
            values[name] = black + (factor - black) * (factors[:, k] if factor.ndim else factors[:, k, 0])
        coat = (wi, wo) if to_coat is None else tuple(np.einsum("nij,nj->ni", to_coat, each) for each in (wi, wo))
        value = gltf_reflection(replace(self._inputs, **values), (wi, wo), (coat[0], coat[1]))
        value[np.maximum(wi[:, 2], coat[0][:, 2]) <= kinds.GRAZING] = 0.0
        return value, pdf


class JudgedErrors(NamedTuple):
    """relRMSE of a picture without the judge's noise, the relative difference of means with its standard error, and the
    judge's noise."""

    rmse: float
    mean: float
    mean_deviation: float
    noise: float


def judged_errors(ours: NDArray[np.floating], halves: NDArray[np.floating]) -> JudgedErrors:
    """The errors of pixels (N, 3) against two independent estimates of them (2, N, 3).

    The noises a and b of the estimates are independent: E[(e + a)(e + b)] = e², so that the mean product of both
    differences has no noise in it, and halves of any noise do. All are clamped at the 99.9 percentile of the truth
    [docs/conventions.md].
    """
    top = np.percentile(halves.mean(axis=0), CLAMP_PERCENTILE)
    ours, halves = np.minimum(np.float64(ours), top), np.minimum(np.float64(halves), top)
    mean, (first, second) = halves.mean(), ours - halves
    # Half of the difference of both estimates deviates as their mean does; pixels are independent, channels are not.
    noise = 0.5 * (halves[0] - halves[1])
    return JudgedErrors(
        float(np.sqrt(max((first * second).mean(), 0.0)) / mean),
        float(0.5 * (first + second).mean() / mean),
        float(np.sqrt((noise.mean(axis=1) ** 2).sum()) / len(noise) / mean),
        float(np.sqrt((noise**2).mean()) / mean),
    )


def measure(case: Case, shape: str, light: str, environment: Path, folder: Path, side: int = SIDE) -> JudgedErrors:
    """The errors of our picture against two independent ones of the judge, over the pixels that the object covers."""
    project = _project(case, shape, light, environment, folder, side)
    ours = render_picture(project, lambda _: None, series=BounceSeries(1))
    halves = np.stack([_judged(case, shape, project, seed) for seed in (0, 1)])
    hits = Placement(project.scene).hits
    begin, end = hits.object_ranges[0]
    counts = np.bincount(hits.pixel[begin:end], minlength=ours.shape[0] * ours.shape[1])
    seen = counts.reshape(ours.shape[:2]) > 0
    if shape == "quad":  # pixels whose neighbours are covered, too: the judge's rays are all over them
        seen &= np.logical_and.reduce([np.roll(seen, by, axis) for axis in (0, 1) for by in (-1, 1)])
    return judged_errors(ours[seen], halves[:, seen])


def measure_layers(case: Case, shape: str, light: str, environment: Path, folder: Path, side: int = SIDE) -> Errors:
    """The error of the layers themselves: of paths that they reflect, against the judge's with equal random numbers,
    which differ by what the layers differ from the formulas and by little else."""
    project = _project(case, shape, light, environment, folder, side)
    layers_of = {0: tuple(layer for j, layer in project.indexed_layers if j == 0)}
    placement = Placement(project.scene, None, 0)
    found = run_to_end(trace_paths(placement, layers_of, project.sky, 1, 256))
    return errors(found.radiance, _judged_paths(case, shape, project, placement, 256))


def _judged(case: Case, shape: str, project: Project, seed: int) -> NDArray[np.floating]:
    """The judge's picture at the project's resolution, of half the paths."""
    finer = FINER if shape == "quad" else 1
    camera, side = project.scene.description.camera, project.scene.resolution[0]
    placement = Placement(project.scene.from_camera(camera, (side * finer,) * 2), None, 0)
    picture = np.zeros((side * finer * side * finer, 3))
    n_samples = max(N_SAMPLES[shape] * 32**2 // (2 * side**2), 2)
    picture[placement.hits.pixel] = _judged_paths(case, shape, project, placement, n_samples, seed)
    return box_averaged(picture.reshape(side * finer, side * finer, 3), finer)


def _judged_paths(
    case: Case, shape: str, project: Project, placement: Placement, n_samples: int, seed: int = 0
) -> NDArray[np.floating]:
    """Radiance (P, 3) of the hits by the formula."""
    textures = case.channels if shape == "quad" else []
    maps = [_texture_maps(k, texture) for k, texture in textures]
    painted = [make_layer(MODELS["lambert"]).replace(maps=each) for each in maps]
    layers_of = {i: (*painted, *[layer for j, layer in project.indexed_layers if j == i]) for i in (0,)}

    def scattering(layers: Sequence[Layer]) -> Scattering:
        return AuthoredScattering(layers, case, len(textures)) if layers else Scattering(())

    traced = trace_paths(placement, layers_of, project.sky, 1, n_samples, seed, scattering=scattering)
    return run_to_end(traced).radiance


def _texture_maps(k: int, texture: Texture) -> LayerMaps:
    name = f"model.glb#{k}"
    return (
        LayerMaps(name, "srgb") if texture.channel is None else LayerMaps(weight=name, weight_channel=texture.channel)
    )


def _project(case: Case, shape: str, light: str, environment: Path, folder: Path, side: int) -> Project:
    """The scene of one picture, its object first, written to a folder and opened."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.glb").write_bytes(_glb(case, shape))
    eye = "[0.0, 0.0, 1.6]" if shape == "sphere" else "[0.0, -1.0, 0.75]"
    text = (
        f"version = 1\nbounces = 1\n[camera]\nposition = {eye}\ntarget = [0, 0, 0]\nfov_y = 38\n"
        f'resolution = [{side}, {side}]\n[[object]]\nname = "it"\nmesh = "model.glb"\n'
    )
    if light == "lamp":  # a square above, to the left and in front
        text += '[[object]]\nname = "lamp"\nprimitive = "quad"\nemission = [12, 12, 12]\n'
        text += f"transform = [{_facing((-1.2, 1.2, 1.2), 0.8)}, 0, 0, 0, 1]\n"
    else:
        shutil.copyfile(environment, folder / f"light{environment.suffix}")
        text += f'[environment]\nfile = "light{environment.suffix}"\n'
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return open_project(str(folder / "scene.toml")).with_settings(n_edge_rays=0)


def _facing(place: tuple[float, float, float], side: float) -> str:
    """The transform of the unit square at a place, facing the origin."""
    z = -np.array(place) / np.linalg.norm(place)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    return ", ".join(f"{v:.6f}" for v in np.column_stack([side * x, side * y, side * z, place]).ravel())


def _glb(case: Case, shape: str) -> bytes:
    """The case as a GLB file: of the quad with its textures, of the sphere with normal maps alone."""
    mesh = sphere() if shape == "sphere" else quad()
    corners = mesh.triangles.ravel()
    assert mesh.normals is not None and mesh.uvs is not None
    uvs = mesh.uvs.reshape(-1, 2) * [1.0, -1.0] + [0.0, 1.0]  # v grows downwards there
    parts = [mesh.vertices[corners].astype("<f4"), mesh.normals[corners].astype("<f4"), uvs.astype("<f4")]
    material = json.loads(json.dumps(case.material))
    textures = list(case.textures.items()) if shape == "quad" else []
    for k, path in enumerate((*(path for path, _ in textures), *case.normals)):
        *above, key = path.split(".")
        there = material
        for name in above:
            there = there.setdefault(name, {})
        there[key] = {"index": k}
    images = [_png(k, channels) for k, (_, channels) in enumerate(textures)] + [_waves() for _ in case.normals]
    chunks = [each.tobytes() for each in parts] + images
    binary, views = b"", []
    for chunk in chunks:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(chunk)})
        binary += chunk + b"\0" * (-len(chunk) % 4)
    accessors = [
        {"bufferView": k, "componentType": 5126, "count": len(part), "type": f"VEC{part.shape[1]}"}
        for k, part in enumerate(parts)
    ]
    low, high = parts[0].min(axis=0).tolist(), parts[0].max(axis=0).tolist()
    accessors[0] |= {"min": low, "max": high}
    attributes = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "material": 0}]}], "materials": [material],
        "textures": [{"source": k} for k in range(len(images))],
        "images": [{"bufferView": len(parts) + k, "mimeType": "image/png"} for k in range(len(images))],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}],
    }  # fmt: skip
    text = json.dumps({key: value for key, value in tree.items() if value}).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _png(seed: int, channels: Sequence[Texture]) -> bytes:
    """A texture of 64 x 64 texels with colours, edges and a slope, and opacity if that counts; one for each seed. Those
    of roughness and thickness go down to 0.35."""
    generator, side = np.random.default_rng(seed), 64
    is_number = any("rough" in each.name or "thick" in each.name for each in channels)
    tiles = generator.integers(128 if is_number else 40, 256, (8, 8, 4)).repeat(8, axis=0).repeat(8, axis=1)
    slope = np.linspace(0.7 if is_number else 0.4, 1.0, side)[:, None, None]
    if not any(each.channel == "a" for each in channels):
        tiles[..., 3] = 255
    buffer, slope = io.BytesIO(), np.concatenate([slope.repeat(3, axis=2), np.ones((side, 1, 1))], axis=2)
    pixels = (tiles * slope).astype(np.uint8)
    if any(each.name == "anisotropy" for each in channels):  # red and green are the direction: along u
        pixels[..., :2] = 255, 128
    Image.fromarray(pixels, "RGBA").save(buffer, "PNG")
    return buffer.getvalue()


def _waves() -> bytes:
    """A normal map of one wave each way, up to 14 degrees steep: broad, for a pixel has the mean of its normals. With
    two waves, up to 22 degrees, a coat of roughness 0.3 under the lamp is 9 % off."""
    slope = 0.25 * np.sin((np.arange(64) + 0.5) / 64 * 2.0 * np.pi)
    normals = np.stack(np.broadcast_arrays(slope[None, :], slope[:, None], 1.0), axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    buffer = io.BytesIO()
    Image.fromarray(np.round(127.5 + 127.5 * normals).astype(np.uint8), "RGB").save(buffer, "PNG")
    return buffer.getvalue()


def main() -> None:
    arguments = argparse.ArgumentParser(prog="python -m benchmarks.gltf_materials")
    arguments.add_argument("environment", type=Path)
    arguments.add_argument("--side", type=int, default=SIDE, help="pixels of a side of the pictures")
    arguments.add_argument("cases", nargs="*", default=list(CASES))
    given = arguments.parse_args()
    print(
        "| material | layers | sphere, environment | sphere, lamp | textured quad, environment | textured quad, lamp |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for name in given.cases:
            found = [
                measure(CASES[name], shape, light, given.environment, Path(folder, f"{shape}-{light}"), given.side)
                for shape in ("sphere", "quad")
                for light in LIGHTS
            ]
            of_layers = measure_layers(
                CASES[name], "quad", "environment", given.environment, Path(folder, "quad-environment"), given.side
            )
            row = [f"{of_layers.rmse:.2%}", *(_words(each) for each in found)]
            print(f"| {name} | {' | '.join(row)} |", flush=True)


def _words(found: JudgedErrors) -> str:
    """In percent."""
    rmse, mean, deviation, noise = (100.0 * value for value in found)
    return f"{rmse:.2f} % ({mean:+.2f} ± {deviation:.2f}); {noise:.2f}"


if __name__ == "__main__":
    main()
