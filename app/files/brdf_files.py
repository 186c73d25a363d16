"""`insitu import-brdf` and `insitu export-brdf`: measured files to materials, materials to MERL files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from app.document.named_files import with_measurements
from app.files.materials import Material, dump_material, measured_layers
from app.system.atomic import require_place, save_file, set_inputs
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.core.safe_files import resolved
from engine.material.layer import Layer
from engine.measured.measurement import Measurement, Part
from engine.measured.sample_files import MERL_SUFFIX, merl_bytes
from engine.measured.tables import ArrayStore, read_measurement
from engine.render.tabulate import tabulate_layers

Report = Callable[[float, str], None]


def import_file(
    file: Path, output: Path, smoothing: float, cloth: bool, store: ArrayStore, report: Report
) -> Measurement:
    """Read and fit a measured file (or find it in the store) and write it as a material. Raises InsituError."""
    if output.suffix != ".toml":
        raise InsituError(f"{output}: the name of a material ends in .toml")
    set_inputs([file])
    require_place(output)
    measurement = run_to_end(read_measurement(resolved(file), store), lambda step: report(*step))
    layers = with_measurements(measured_layers(file, cloth), {str(resolved(file)): measurement})
    smooth = tuple(layer.with_parameter("smoothing", smoothing) for layer in layers)
    name = file.stem[:64].encode(errors="replace").decode()  # "?" for invalid characters
    text = dump_material(Material(name, smooth, "Measured"), resolved(output).parent)
    save_file(output, text.encode())
    return measurement


def import_lines(measurement: Measurement, cloth: bool) -> list[str]:
    """The report on an import."""
    report = measurement.report
    assert report is not None
    parts: dict[str, Part] = {"whole": "whole"} if cloth else {"diffuse": "diffuse", "highlight": measurement.highlight}
    strengths = ", ".join(
        f"{name} {' '.join(f'{value:.4g}' for value in measurement.strength(part))}" for name, part in parts.items()
    )
    error = report.error_whole if cloth else report.error
    return [
        f"method        {report.method}",
        f"filled        {report.n_missing:,} samples missing above the horizon, {report.n_below:,} below it",
        f"factors       {strengths} (1/sr, red green blue)",
        f"fit error     {error:.3f} log RMS of the factors alone; the layers store the residual, so they are exact",
    ]


def export_steps(layers: Sequence[Layer], output: Path) -> Iterator[float]:
    """Write the reflection of layers as a MERL file; yields the fraction done. Raises InsituError."""
    check_merl_name(output)
    require_place(output)
    for step in tabulate_layers(layers):
        if isinstance(step, float):
            yield step
        else:
            save_file(output, merl_bytes(step))


def check_merl_name(path: Path) -> None:
    """Raise InsituError for a name that no reader of such files would accept."""
    if path.suffix.lower() != MERL_SUFFIX:
        raise InsituError(f"{path}: the name of a MERL file ends in {MERL_SUFFIX}")
