"""Matching pictures that another program made of known materials: how near the curve comes, and how near the material
that was found is to the known one in another light, from another side.

The pictures are Mitsuba's, small and as noisy as a photograph, about 1 %: `benchmarks/photos/NAME.exr`, and
`NAME_elsewhere.exr` in another light. `python -m benchmarks.photos PYTHON`, with an interpreter that has Mitsuba 3,
makes them anew.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import OpenEXR
import trimesh
from numpy.typing import NDArray
from PIL import Image

from app.document.view_state import Viewpoint
from app.photo.photo_match import DETERMINED, PhotoOutcome, match_photo
from app.photo.photo_request import PhotoRequest
from app.project.project import Project, open_project
from app.stills.stills import render_picture
from benchmarks.figures import Figure, not_measured
from engine.core.colour import encode_srgb
from engine.core.generators import run_to_end
from engine.inverse.curve_fit import SCALE
from engine.inverse.photo_view import inner_pixels
from engine.light.radiance_files import read_radiance_image
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.scene.builtin import builtin_environments

NAMES = ("photo_curve_error", "photo_relight_error")
FOLDER, PROGRAM = Path(__file__).with_name("photos"), Path(__file__).with_name("programs") / "mitsuba_stills.py"
SIZE, OTHER_SIZE, BOUNCES = (256, 192), (128, 96), 3
# As noisy as a photograph; in the other light hardly noisy, because that is what is compared with.
SAMPLES, OTHER_SAMPLES = 1024, 16384
# The exposure of photographs of 8 bits: some of the highlight is clipped.
EXPOSURE = 0.6
SCENE = """version = 1
[camera]
position = [{position}]
target = [0.0, 0.35, 0.0]
fov_y = 34.0
resolution = [{width}, {height}]
[environment]
file = "{environment}.exr"
[[object]]
name = "ball"
primitive = "sphere"
transform = [0.5, 0, 0, 0, 0, 0.5, 0, 0.5, 0, 0, 0.5, 0, 0, 0, 0, 1]
layer = [{layers}]
[[object]]
name = "ground"
primitive = "quad"
transform = [6.0, 0, 0, 0, 0, 0, 6.0, 0, 0, -6.0, 0, 0, 0, 0, 0, 1]
layer = [{{ model = "lambert", albedo = [0.4, 0.4, 0.4] }}]
"""
LAMP = """[[object]]
name = "lamp"
primitive = "quad"
transform = [1.0, 0, 0, 0.6, 0, 0, -1.0, 2.2, 0, 1.0, 0, 0.5, 0, 0, 0, 1]
emission = [9.0, 9.0, 8.0]
"""
GOLD = "eta = [0.2004, 0.924, 1.1022], k = [3.9129, 2.4528, 2.1421]"
FRONT, SIDE = "0.0, 1.1, 2.6", "1.9, 0.8, 1.7"


@dataclass(frozen=True)
class Case:
    """layers: of the ball that was photographed, and start: of that whose material is found; with a lamp or not;
    elsewhere: the case whose picture in another light is the same, "" for its own."""

    layers: str
    start: str
    lamp: bool = False
    elsewhere: str = ""


def _metal(alpha: float, scale: float = 1.0, distribution: str = "ggx") -> str:
    own = f'distribution = "{distribution}", alpha = {alpha}, scale = {scale}'
    return f'{{ model = "rough_conductor", {own}, {GOLD} }}'


def _paint(red: float, green: float, blue: float) -> str:
    return f'{{ model = "lambert", albedo = [{red}, {green}, {blue}] }}, '


CASES = {
    "ggx": Case(_metal(0.25, 0.8), _metal(0.12)),
    "beckmann": Case(_metal(0.2, 0.9, "beckmann"), _metal(0.12)),
    "two_layers": Case(_paint(0.1, 0.2, 0.35) + _metal(0.18, 0.3), _paint(0.5, 0.5, 0.5) + _metal(0.08, 0.5)),
    "lamp": Case(_metal(0.25, 0.8), _metal(0.12), lamp=True, elsewhere="ggx"),
}


@dataclass(frozen=True)
class PhotoEffort:
    """The cases that are matched."""

    cases: tuple[str, ...] = tuple(CASES)


def photo_figures(effort: PhotoEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """Both of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    curves, relit = dict[str, float](), dict[str, float]()
    for name in effort.cases:
        for in_8_bits in (False, True):
            report(f"matching the picture of {name}")
            with _scenes(name) as (truth, start, elsewhere), tempfile.TemporaryDirectory() as folder:
                photo = _photograph(name, in_8_bits, Path(folder))
                outcome = run_to_end(match_photo(start, PhotoRequest("ball", photo, n_bounces=BOUNCES)))
                key = f"{name}, 8 bits" if in_8_bits else name
                curves[key] = curve_error(outcome, truth)
                relit[key] = _relight_error(name, outcome, elsewhere)
    of = f"a ball at {SIZE[0]} x {SIZE[1]}, matched to Mitsuba's pictures of {SAMPLES} samples"
    return [
        Figure(NAMES[0], tuple(curves.values()), f"{of}: its curve, where it is known within {DETERMINED:.0%}", curves),
        Figure(NAMES[1], tuple(relit.values()), f"{of}: as Mitsuba has it in another light from another side", relit),
    ]


def curve_error(outcome: PhotoOutcome, truth: Project) -> float:
    """relRMSE of the band values of the curve that was found, times the layer's scale, in bands that are determined."""
    (target,) = (each for each in outcome.match.deviations if each.name != SCALE)
    deviation = outcome.match.deviations[target]
    found, wanted = outcome.match.layers[target.layer], truth.document.object("ball").layers[target.layer]
    ours, other = (each.coefficients(target.name, len(deviation)) * each.scale() for each in (found, wanted))
    known = (deviation * found.scale() < DETERMINED * ours).all(axis=1)
    return float(np.linalg.norm((ours - other)[known]) / np.linalg.norm(other[known]))


def _relight_error(name: str, outcome: PhotoOutcome, elsewhere: Project) -> float:
    """relRMSE of the ball with the material that was found, against the other program's picture."""
    ball = replace(elsewhere.document.object("ball"), layers=outcome.match.layers)
    document = elsewhere.document.with_object(ball)
    found = elsewhere.edited(document, Viewpoint(None, None))
    ours = render_picture(found, lambda step: None, series=BounceSeries(BOUNCES))
    other = read_radiance_image(FOLDER / f"{CASES[name].elsewhere or name}_elsewhere.exr")
    hits = Placement(found.scene).hits
    counts = inner_pixels(hits, np.ones(other.shape[:2], bool)) == found.scene.object_index("ball")
    return float(np.linalg.norm((ours - other)[counts]) / np.linalg.norm(other[counts]))


def _photograph(name: str, in_8_bits: bool, folder: Path) -> Path:
    """The photograph of a case, as linear light or as a file of 8 bits."""
    if not in_8_bits:
        return FOLDER / f"{name}.exr"
    light = read_radiance_image(FOLDER / f"{name}.exr")
    code = np.round(255.0 * encode_srgb(np.clip(EXPOSURE * light, 0.0, 1.0))).astype(np.uint8)
    Image.fromarray(code).save(folder / f"{name}.png")
    return folder / f"{name}.png"


@contextmanager
def _scenes(name: str) -> Iterator[tuple[Project, Project, Project]]:
    """The scene that was photographed, the one whose material is found, and that in another light."""
    case = CASES[name]
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        for environment in ("studio", "hall"):
            shutil.copy(builtin_environments()[environment], folder)
        made = []
        wanted = [
            (case.layers, FRONT, "studio", SIZE),
            (case.start, FRONT, "studio", SIZE),
            (case.layers, SIDE, "hall", OTHER_SIZE),
        ]
        for i, (layers, position, environment, (width, height)) in enumerate(wanted):
            text = SCENE.format(layers=layers, position=position, environment=environment, width=width, height=height)
            file = Path(folder) / f"{i}.toml"
            file.write_text(text + (LAMP if case.lamp and environment == "studio" else ""))
            made.append(open_project(str(file)))
        yield made[0], made[1], made[2]


# ------------------------------------------------------------------------------------------------- making the pictures


def make_photographs(python: str) -> None:
    """Have Mitsuba draw all pictures, by an interpreter that has it."""
    FOLDER.mkdir(exist_ok=True)
    for name in CASES:
        with _scenes(name) as (truth, _, elsewhere):
            wanted = [(truth, f"{name}.exr"), (elsewhere, f"{name}_elsewhere.exr")]
            for project, file in wanted[: 1 if CASES[name].elsewhere else 2]:
                picture = _drawn(python, project, SAMPLES if project is truth else OTHER_SAMPLES)
                _write_half(FOLDER / file, picture)
                print(f"{file}: mean {picture.mean():.4f}")


def _drawn(python: str, project: Project, n_samples: int) -> NDArray[np.float32]:
    """Mitsuba's picture of a scene, with the scene's own meshes."""
    scene = project.scene
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as name:
        folder, described = Path(name), tomllib.loads(scene.file.read_text())
        shutil.copy(scene.file.parent / described["environment"]["file"], folder)
        text = [scene.file.read_text().partition("[[object]]")[0]]
        for i, each in enumerate(described["object"]):
            _write_mesh(folder / f"{i}.ply", project, i)
            own = [f"[[object]]\nname = {each['name']!r}\nmesh = '{i}.ply'"]
            own += [f"{key} = {each[key]}" for key in ("emission",) if key in each]
            own += [f"[[object.layer]]\n{_toml(layer)}" for layer in each.get("layer", [])]
            text.append("\n".join(own))
        (folder / "scene.toml").write_text("\n".join(text))
        numbers = (*scene.resolution, BOUNCES, n_samples, 1)
        command = [python, str(PROGRAM), str(folder / "scene.toml"), str(folder / "out.npz"), *map(str, numbers)]
        subprocess.run(command, check=True)
        with np.load(folder / "out.npz") as found:
            return np.asarray(found["pictures"][0], np.float32)


def _write_half(file: Path, picture: NDArray[np.float32]) -> None:
    """An OpenEXR file of 16-bit numbers: a third of the size, and far more precise than the picture is."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": OpenEXR.Channel(picture.astype(np.float16))}) as made:
        made.write(str(file))


def _toml(table: dict[str, object]) -> str:
    return "\n".join(f"{key} = {value!r}" for key, value in table.items())


def _write_mesh(file: Path, project: Project, i_object: int) -> None:
    scene, (begin, end) = project.scene, project.scene.triangle_ranges[i_object]
    mesh = trimesh.Trimesh(
        scene.vertices + scene.origin, scene.triangles[begin:end], vertex_normals=scene.normals, process=False
    )
    mesh.export(file, vertex_normal=True)


if __name__ == "__main__":
    make_photographs(sys.argv[1])
