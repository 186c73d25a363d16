"""The worker's part of files: measured BRDFs read into tables, once, and cached on disk; materials written as such
files, and scenes for other programs."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.document.document import Document
from app.document.named_files import files_of_document, layers_of_document, measured_files, with_measurements
from app.export.environment import write_environment
from app.files.brdf_files import export_steps
from app.files.material_files import read_file_materials
from app.messages.file_messages import (
    ColourViewRead,
    CurveTableRead,
    FilesWritten,
    MaterialsRead,
    MeasurementsRead,
    PictureRead,
    ReadColourView,
    ReadCurveTable,
    ReadMaterials,
    ReadMeasured,
    ReadPicture,
    SaveEnvironment,
    SaveScene,
    WriteFiles,
)
from app.messages.worker_messages import FetchTable, Progress, Response, TableFetched
from app.project.project import Project
from app.system.atomic import set_inputs
from engine.core.colour_config import read_view
from engine.core.errors import InsituError, LoadError
from engine.core.generators import map_steps
from engine.core.safe_files import resolve_inside
from engine.curve.table_text import load_table, parse_table
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ChannelStatistics
from engine.measured.measurement import Measurement
from engine.measured.tables import ArrayStore, is_table_loaded, read_measurement, table_of
from engine.planner import band_counts
from engine.precompute.direct.pipeline import SkyState
from engine.render.picture_files import read_picture
from engine.render.tabulate import untabulated_features
from engine.scene.scene_loader import Scene

STAGE = "measured BRDF"
NO_TABLE = np.zeros((1, 1, 1, 3), np.float32)

ReadSteps = Generator[Response | None, None, dict[str, Measurement]]


def read_files(files: Mapping[str, Path], store: ArrayStore | None) -> ReadSteps:
    """The measurements of files, by the names of the request. Raises LoadError."""
    found: dict[str, Measurement] = {}
    for name, path in files.items():
        found[name] = yield from map_steps(
            read_measurement(path, store),
            lambda step: Progress(STAGE, (len(found) + step[0]) / len(files), text=step[1]),
        )
    return found


def read_for(request: ReadMeasured, store: ArrayStore | None) -> Generator[Response | None, None, None]:
    """The measurements of files, and the plans of the layers that wait for them. Raises LoadError."""
    found = yield from read_files({file: Path(file) for file in request.files}, store)
    bands = []
    for layer in with_measurements(request.layers, found):
        bands.append(band_counts(layer))
        yield None
    yield MeasurementsRead(found, tuple(bands))


def read_materials(request: ReadMaterials) -> Generator[Response | None, None, None]:
    """The materials of a MaterialX file, and the plan of the one that was asked for. Raises LoadError."""
    yield Progress("material", 0.0, text=f"reading {Path(request.file).name}")
    found = read_file_materials(Path(request.file), request.name)
    bands = []
    for layer in found.chosen.layers:
        bands.append(band_counts(layer))
        yield None
    yield MaterialsRead(found.materials, found.chosen, tuple(bands), found.notes)


def read_curve_table(request: ReadCurveTable) -> Generator[Response | None, None, None]:
    """The table of a curve. Raises LoadError."""
    if request.text is None:
        yield CurveTableRead(load_table(Path(request.name)))
    else:
        yield CurveTableRead(parse_table(request.text.encode(errors="replace"), request.name))


def read_colour_view(request: ReadColourView) -> Generator[Response | None, None, None]:
    """A view of an OpenColorIO configuration. Raises LoadError."""
    yield ColourViewRead(*read_view(request.view))


def read_stored_picture(request: ReadPicture) -> Generator[Response | None, None, None]:
    """A finished picture. Raises LoadError."""
    light = read_picture(Path(request.file), request.may_have_gaps)
    yield PictureRead(np.dstack([light, np.ones(light.shape[:2], np.float32)]))


def read_channels(
    scene: Scene, images: Iterable[ChannelImage]
) -> tuple[dict[ChannelImage, ChannelStatistics], dict[ChannelImage, str]]:
    """The statistics of images, and of those that cannot be read the reason, in one line."""
    found, refused = {}, {}
    for image in images:
        try:
            found[image] = scene.textures.channel_statistics(image)
        except LoadError as error:
            refused[image] = " ".join(str(error).split())
    return found, refused


def described_paths(names: Iterable[str], folder: Path, scene: Path) -> dict[str, Path]:
    """The paths of files that a scene names: in its folder. Raises LoadError for any other place."""
    return {name: resolve_inside(folder, name, scene, "layer: file") for name in names}


def ensure_tables(layers: Iterable[Layer], store: ArrayStore | None) -> Generator[Response | None, None, None]:
    """Read the measurements of these layers where this process has no table of them, as one that has just started.
    Raises InsituError where a file has changed since."""
    missing = [(file, number) for file, number in measured_files(layers) if not is_table_loaded(number)]
    found = yield from read_files({file: Path(file) for file, _ in missing}, store)
    for file, number in missing:
        _check_unchanged(file, number, found[file])


def fetch_table(request: FetchTable, store: ArrayStore | None) -> Generator[Response | None, None, None]:
    """The table of a file; a single value of one that is anisotropic, whose form only kernels read. Raises InsituError,
    also where the file has changed since."""
    if is_table_loaded(request.number):
        measurement = replace(table_of(request.number).measurement, file=request.file)
    else:
        measurement = (yield from read_files({request.file: Path(request.file)}, store))[request.file]
        _check_unchanged(request.file, request.number or measurement.number, measurement)
    samples = NO_TABLE if measurement.is_anisotropic else table_of(measurement.number).samples
    yield TableFetched(measurement, samples)


def _check_unchanged(file: str, number: int, found: Measurement) -> None:
    if found.number != number:
        raise InsituError(f"{file}: the file has changed since it was imported; import it again")


def write_file(request: WriteFiles, store: ArrayStore | None) -> Generator[Response | None, None, None]:
    """Write a MERL file, whole or not at all. Raises InsituError."""
    yield from ensure_tables(request.layers, store)
    for fraction in export_steps(request.layers, Path(request.path)):
        yield Progress(STAGE, fraction, text=f"writing {Path(request.path).name}")
    yield FilesWritten(request.path, untabulated_features(request.layers))


def save_environment(request: SaveEnvironment, scene: Scene, sky: SkyState) -> Generator[Response | None, None, None]:
    """Write an environment. Raises InsituError."""
    set_inputs((*scene.files, *files_of_document(request.document)))
    yield Progress("export", 0.5, text=f"writing {Path(request.path).name}")
    write_environment(Path(request.path), sky)
    yield FilesWritten(request.path)


def save_scene(request: SaveScene, scene: Scene) -> Generator[Response | None, None, None]:
    """Write a scene's package. Raises InsituError."""
    from app.export.package import package_steps  # late: few sessions save one

    set_inputs((*scene.files, *files_of_document(request.document)))
    steps = package_steps(request.document, request.view, scene.files, Path(request.path))
    package = yield from map_steps(steps, lambda step: Progress("export", step[0], text=f"copying {step[1]}"))
    yield FilesWritten(request.path, package.notes)


def write_scene(
    request: WriteFiles, document: Document, scene: Scene, store: ArrayStore | None
) -> Generator[Response | None, None, None]:
    """Write the folder for Mitsuba 3. Raises InsituError."""
    from app.export.mitsuba import export_steps as scene_steps  # late: few sessions export

    yield from ensure_tables(layers_of_document(document), store)
    set_inputs((*scene.files, *files_of_document(document)))
    steps = scene_steps(Project(scene, document), Path(request.path), request.n_bounces)
    notes = yield from map_steps(steps, lambda step: Progress("export", step[0], text=f"writing {step[1]}"))
    yield FilesWritten(request.path, tuple(notes))
