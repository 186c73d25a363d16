"""Pictures of materials of files, as we make them, against paths whose BRDF is a formula that gets factors and
textures, at full resolution of the textures: what the benchmarks of glTF's and of MaterialX's materials share.

Each case is a file that is read as any other: a sphere with factors alone, and a quad with textures, seen obliquely,
under an environment and under a lamp. The judge gets factors and textures, not layers; its picture of the quad has 3x3
rays a pixel. Columns: the error without the judge's noise, and in brackets that of the mean with its standard error;
the noise.
"""

from __future__ import annotations

import argparse
import io
import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.measure.subject import box_averaged
from app.project.project import Project, open_project
from app.stills.stills import render_picture
from engine.core.generators import run_to_end
from engine.material import MODELS, kinds, make_layer
from engine.material.layer import Layer
from engine.material.layer_maps import Channel, LayerMaps
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.reference.path_lobes import Scattering
from engine.reference.path_tracer import trace_paths
from engine.render.picture_difference import CLAMP_PERCENTILE, Errors, errors

FINER = 3  # rays of the judge along each side of a pixel of the quad
SIDE = 32
N_SAMPLES = {"sphere": 1024, "quad": 128}  # of the judge at 32 x 32; fewer at larger sizes, for as many paths in all
RAYS_OF_LAYERS, N_SAMPLES_OF_LAYERS = 8, 4


Directions = tuple[NDArray[np.float64], NDArray[np.float64]]  # to light and view, in the frame of a base or a coat


class Texture(NamedTuple):
    """A channel of a texture of a case: the input that it multiplies, and the channel, None for all colours; black: the
    input where it is black."""

    name: str
    channel: Channel | None = None
    black: float = 0.0


class MaterialCase(ABC):
    """A material of a file with textures, and its formula."""

    inputs: Any
    """What the judge makes of the factors: a frozen dataclass."""

    @property
    @abstractmethod
    def channels(self) -> list[tuple[int, Texture]]:
        """The number of a texture and each of its channels."""

    @abstractmethod
    def image(self, k: int) -> str:
        """The name of a texture in layers."""

    @abstractmethod
    def write(self, shape: str, folder: Path) -> tuple[str, list[tuple[str, str]]]:
        """Write the file of a shape to a folder; the keys of the scene's object "it", and values to set in the project.
        Of the quad it has the textures, of the sphere none."""

    @abstractmethod
    def reflection(self, inputs: Any, base: Directions, coat: Directions) -> NDArray[np.float64]:
        """The formula times the cosine of the light (N, 3), for inputs with textures applied."""


LIGHTS = ("environment", "lamp")


class AuthoredScattering(Scattering):
    """The judge's BRDF. Of the layers the first ones have the textures, one each; sampling follows the others."""

    def __init__(self, layers: Sequence[Layer], case: MaterialCase, n_textures: int) -> None:
        super().__init__(layers[n_textures:])
        self._case, self._channels = case, [channel for _, channel in case.channels][:n_textures]

    def evaluate(
        self, wi: NDArray[np.float64], wo: NDArray[np.float64], factors: NDArray[np.floating] | None = None,
        texels: NDArray[np.float64] | None = None, to_coat: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
        value, pdf = super().evaluate(wi, wo, to_coat=to_coat)
        values = dict[str, Any]()
        for k, (name, _, black) in enumerate(self._channels):
            assert factors is not None
            factor = np.asarray(getattr(self._case.inputs, name))
            values[name] = black + (factor - black) * (factors[:, k] if factor.ndim else factors[:, k, 0])
        coat = (wi, wo) if to_coat is None else tuple(np.einsum("nij,nj->ni", to_coat, each) for each in (wi, wo))
        value = self._case.reflection(replace(self._case.inputs, **values), (wi, wo), (coat[0], coat[1]))
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


def measure(
    case: MaterialCase, shape: str, light: str, environment: Path, folder: Path, side: int = SIDE
) -> JudgedErrors:
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


def measure_layers(
    case: MaterialCase, shape: str, light: str, environment: Path, folder: Path, side: int = SIDE
) -> Errors:
    """The error of the layers themselves: of paths that they reflect, against the judge's with equal random numbers,
    which differ by what the layers differ from the formulas and by little else. Rays are so dense that a texture is
    filtered little: a formula that is not linear in it has another value at a mean of texels than in the mean."""
    project = _project(case, shape, light, environment, folder, side)
    layers_of = {0: tuple(layer for j, layer in project.indexed_layers if j == 0)}
    placement, n_samples = _finer(project, RAYS_OF_LAYERS), N_SAMPLES_OF_LAYERS
    found = run_to_end(trace_paths(placement, layers_of, project.sky, 1, n_samples)).radiance
    judged = _judged_paths(case, shape, project, placement, n_samples)
    return errors(*(_averaged(each, placement, RAYS_OF_LAYERS) for each in (found, judged)))


def _judged(case: MaterialCase, shape: str, project: Project, seed: int) -> NDArray[np.floating]:
    """The judge's picture at the project's resolution, of half the paths."""
    finer = FINER if shape == "quad" else 1
    placement = _finer(project, finer)
    n_samples = max(N_SAMPLES[shape] * 32**2 // (2 * project.scene.resolution[0] ** 2), 2)
    return _averaged(_judged_paths(case, shape, project, placement, n_samples, seed), placement, finer)


def _finer(project: Project, finer: int) -> Placement:
    """The camera's rays, finer x finer in each pixel."""
    scene = project.scene
    side = scene.resolution[0] * finer
    return Placement(scene.from_camera(scene.description.camera, (side, side)), None, 0)


def _averaged(radiance: NDArray[np.floating], placement: Placement, finer: int) -> NDArray[np.floating]:
    """The picture of pixels with finer x finer rays, of the radiance (P, 3) of their hits."""
    width, height = placement.scene.resolution
    picture = np.zeros((width * height, 3))
    picture[placement.hits.pixel] = radiance
    return box_averaged(picture.reshape(height, width, 3), finer)


def _judged_paths(
    case: MaterialCase, shape: str, project: Project, placement: Placement, n_samples: int, seed: int = 0
) -> NDArray[np.floating]:
    """Radiance (P, 3) of the hits by the formula."""
    textures = case.channels if shape == "quad" else []
    maps = [_texture_maps(case.image(k), texture) for k, texture in textures]
    painted = [make_layer(MODELS["lambert"]).replace(maps=each) for each in maps]
    layers_of = {i: (*painted, *[layer for j, layer in project.indexed_layers if j == i]) for i in (0,)}

    def scattering(layers: Sequence[Layer]) -> Scattering:
        return AuthoredScattering(layers, case, len(textures)) if layers else Scattering(())

    traced = trace_paths(placement, layers_of, project.sky, 1, n_samples, seed, scattering=scattering)
    return run_to_end(traced).radiance


def _texture_maps(name: str, texture: Texture) -> LayerMaps:
    return (
        LayerMaps(name, "srgb") if texture.channel is None else LayerMaps(weight=name, weight_channel=texture.channel)
    )


def _project(case: MaterialCase, shape: str, light: str, environment: Path, folder: Path, side: int) -> Project:
    """The scene of one picture, its object first, written to a folder and opened."""
    folder.mkdir(parents=True, exist_ok=True)
    own, values = case.write(shape, folder)
    eye = "[0.0, 0.0, 1.6]" if shape == "sphere" else "[0.0, -1.0, 0.75]"
    text = (
        f"version = 1\nbounces = 1\n[camera]\nposition = {eye}\ntarget = [0, 0, 0]\nfov_y = 38\n"
        f'resolution = [{side}, {side}]\n[[object]]\nname = "it"\n{own}\n'
    )
    if light == "lamp":  # a square above, to the left and in front
        text += '[[object]]\nname = "lamp"\nprimitive = "quad"\nemission = [12, 12, 12]\n'
        text += f"transform = [{_facing((-1.2, 1.2, 1.2), 0.8)}, 0, 0, 0, 1]\n"
    else:
        shutil.copyfile(environment, folder / f"light{environment.suffix}")
        text += f'[environment]\nfile = "light{environment.suffix}"\n'
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return open_project(str(folder / "scene.toml"), values=values).with_settings(n_edge_rays=0)


def _facing(place: tuple[float, float, float], side: float) -> str:
    """The transform of the unit square at a place, facing the origin."""
    z = -np.array(place) / np.linalg.norm(place)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    return ", ".join(f"{v:.6f}" for v in np.column_stack([side * x, side * y, side * z, place]).ravel())


def png(seed: int, channels: Sequence[Texture]) -> bytes:
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


def print_table(cases: Mapping[str, MaterialCase], program: str) -> None:
    """Measure the cases that the command line names, or all, and print a row for each."""
    arguments = argparse.ArgumentParser(prog=f"python -m {program}")
    arguments.add_argument("environment", type=Path)
    arguments.add_argument("--side", type=int, default=SIDE, help="pixels of a side of the pictures")
    arguments.add_argument("cases", nargs="*", default=list(cases))
    given = arguments.parse_intermixed_args()
    print(
        "| material | layers | sphere, environment | sphere, lamp | textured quad, environment | textured quad, lamp |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for name in given.cases:
            found = [
                measure(cases[name], shape, light, given.environment, Path(folder, f"{shape}-{light}"), given.side)
                for shape in ("sphere", "quad")
                for light in LIGHTS
            ]
            of_layers = measure_layers(
                cases[name], "quad", "environment", given.environment, Path(folder, "quad-environment"), given.side
            )
            row = [f"{of_layers.rmse:.2%}", *(_words(each) for each in found)]
            print(f"| {name} | {' | '.join(row)} |", flush=True)


def _words(found: JudgedErrors) -> str:
    """In percent."""
    rmse, mean, deviation, noise = (100.0 * value for value in found)
    return f"{rmse:.2f} % ({mean:+.2f} ± {deviation:.2f}); {noise:.2f}"
