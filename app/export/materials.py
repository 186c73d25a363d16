"""Materials for Mitsuba 3: its own models where they are exact, tables of any others."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.export.images import factor_images
from app.system.atomic import write_atomically
from engine.material.layer import Layer, evaluate_layers
from engine.material.layer_maps import LayerMaps
from engine.material.measured import HIGHLIGHT_MODELS, MeasuredModel, measurement_of
from engine.material.model import channels
from engine.measured.tables import is_content
from engine.measured.tensor_files import TENSOR_SUFFIX, read_tensor_file, tensor_fields
from engine.render.tabulate import is_anisotropic
from engine.scene.map_sampler import mean_factor
from engine.scene.scene_loader import Scene
from engine.scene.tangents import object_axes


def add(parent: Element, tag: str, **attributes: str) -> Element:
    """A child with these attributes."""
    return SubElement(parent, tag, attributes)


def add_numbers(parent: Element, tag: str, name: str, values: ArrayLike) -> Element:
    """A child that holds numbers: `<rgb name="reflectance" value="0.5 0.5 0.5"/>`."""
    return add(parent, tag, name=name, value=" ".join(f"{v:.9g}" for v in np.ravel(values)))


Float64Array = NDArray[np.float64]

# The grid of a table: phi_h (one where nothing changes when the surface is rotated), theta_h, theta_d, phi_d. The
# interpolation error is 0.2 % and 1 % (relative RMS of rho cos theta_i, over all directions); theta_d matters most, at
# grazing angles.
ROUND_SHAPE, TURNED_SHAPE = (1, 160, 90, 64), (36, 40, 72, 32)
LEAST_COSINE = 1e-3
LEAST_ALPHA = 0.01


def write_material(
    shape: Element, layers: Sequence[Layer], scene: Scene, index: int, folder: Path, stem: str
) -> tuple[str, ...]:
    """Add the material of these visible layers of an object, by its index, to a shape, or to what stands for it;
    returns lines on what is not the same there."""
    lambert, metal = _exact(layers)
    measured = _measured_file(layers)
    if not layers:
        add_numbers(add(shape, "bsdf", type="diffuse"), "rgb", "reflectance", (0.0, 0.0, 0.0))
    elif lambert is not None or metal is not None:
        _add_exact(add(shape, "bsdf", type="twosided"), lambert, metal)
    elif measured is not None:
        write_atomically(folder / "materials" / f"{stem}.bsdf", measured)
        bsdf = add(add(shape, "bsdf", type="twosided"), "bsdf", type="measured")
        add(bsdf, "string", name="filename", value=f"materials/{stem}.bsdf")
    else:
        arrays, notes = _tables(layers, scene, index)
        packed = io.BytesIO()
        np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
        write_atomically(folder / "materials" / f"{stem}.npz", packed.getvalue())
        add(add(shape, "bsdf", type="insitu"), "string", name="filename", value=f"materials/{stem}.npz")
        return notes
    return ()


def _tables(
    layers: Sequence[Layer], scene: Scene, index: int
) -> tuple[dict[str, NDArray[np.generic]], tuple[str, ...]]:
    """What `render.py` reads of an object: a table for the sum of all layers with the same images, (K, phi_h, theta_h,
    theta_d, phi_d, 3), and these images, whose product, with vertex colours, multiplies it. Strokes, which lie on the
    surface and not in an image, and images in a second set of texture coordinates, which Mitsuba's meshes have not,
    count by their mean."""
    groups: dict[LayerMaps, list[Layer]] = {}
    for layer in layers:
        groups.setdefault(layer.maps, []).append(layer)
    arrays: dict[str, NDArray[np.generic]] = {}
    tables, means, by_mean = list[NDArray[np.float32]](), list[NDArray[np.float32]](), list[str]()
    for k, (maps, own) in enumerate(groups.items()):
        table = tabulated(own)
        mean = mean_factor(scene, index, maps).astype(np.float32)
        means.append(table * mean)
        # Vertex colours multiply the texture at its full strength alone.
        is_elsewhere = any(each.texture_transform.uv_set for each in maps.images.textures)
        is_mean = bool(maps.strokes or is_elsewhere or (maps.vertex_colours and maps.sampled_strength != 1.0))
        if is_mean:
            table = table * mean
            by_mean += [layer.name for layer in own]
        images = [] if is_mean else factor_images(scene, maps)
        arrays[f"vertex_colours_{k}"] = np.array(maps.vertex_colours and not is_mean)
        for j, image in enumerate(images):
            arrays |= {f"image_{k}_{j}": image.texels, f"matrix_{k}_{j}": image.matrix, f"wrap_{k}_{j}": image.wrap}  # type: ignore[dict-item]
        tables.append(table)
    axes, turns = object_axes(scene)[index, [1, 0]], scene.tangent_rotations.image(index)
    alpha = np.array(highlight_width(np.sum(means, axis=0)), np.float32)
    arrays |= {"table": np.array(tables), "alpha": alpha, "axes": axes.astype(np.float32), "turns": turns}
    return arrays, (f"{', '.join(by_mean)} by the mean of its images",) if by_mean else ()


def _measured_file(layers: Sequence[Layer]) -> bytes | None:
    """The tensor file that these layers are, unedited, as Mitsuba's `measured` reads it where it renders in RGB; None
    for all else, and for anisotropic files, whose tangents are Mitsuba's own."""
    names = {layer.model.name for layer in layers}
    highlights = {model.name for model in HIGHLIGHT_MODELS.values()}
    is_pair = len(names) == 2 and "measured_diffuse" in names and len(names & highlights) == 1
    if not (is_pair or names == {"measured_cloth"}) or len(layers) != len(names):
        return None
    found = {measurement_of(layer.values) for layer in layers if isinstance(layer.model, MeasuredModel)}
    plain = not any(layer.edits or layer.fresnel is not None or not layer.maps.is_plain for layer in layers)
    plain = plain and all((channels(layer.values, "scale") == 1.0).all() for layer in layers)
    measurement = next(iter(found))
    path = Path(measurement.file)
    if len(found) > 1 or not plain or measurement.is_anisotropic or path.suffix.lower() != TENSOR_SUFFIX:
        return None
    data = read_tensor_file(path)
    is_rgb = {"rgb", "luminance", "description"} <= tensor_fields(data, path).keys()
    return data if is_rgb and is_content(measurement, data) else None


def _exact(layers: Sequence[Layer]) -> tuple[Layer | None, Layer | None]:
    """The Lambert and the rough metal that together are a material that Mitsuba has exactly; neither where it does
    not."""
    models = [layer.model.name for layer in layers]
    alone = not any(layer.edits or layer.fresnel is not None or not layer.maps.is_plain for layer in layers)
    if not alone or sorted(models) not in (["lambert"], ["rough_conductor"], ["lambert", "rough_conductor"]):
        return None, None
    lambert = next((layer for layer in layers if layer.model.name == "lambert"), None)
    metal = next((layer for layer in layers if layer.model.name == "rough_conductor"), None)
    if metal is not None and lambert is None and channels(metal.values, "scale").max() > 1.0:
        return None, None
    if lambert is not None and metal is not None and _share(lambert, metal) is None:
        return None, None
    return lambert, metal


def _share(lambert: Layer, metal: Layer) -> float | None:
    """w, so that neither albedo / (1 - w) nor scale / w exceeds 1, as Mitsuba requires; None where there is none."""
    albedo, scale = channels(lambert.values, "albedo").max(), channels(metal.values, "scale").max()
    if albedo + scale > 1.0 or scale <= 0.0:
        return None
    return float(np.clip(scale, 1e-3, 1.0 - albedo))


def _add_exact(parent: Element, lambert: Layer | None, metal: Layer | None) -> None:
    """Mitsuba has no sum of two materials but a blend: (1 - w) a / (1 - w) + w b / w = a + b."""
    share = 1.0
    if lambert is not None and metal is not None:
        share = _share(lambert, metal) or 1.0
        parent = add(parent, "bsdf", type="blendbsdf")
        add(parent, "float", name="weight", value=f"{share:.9g}")
    if lambert is not None:
        of_all = 1.0 - share if metal is not None else 1.0
        diffuse = add(parent, "bsdf", type="diffuse")
        add_numbers(diffuse, "rgb", "reflectance", channels(lambert.values, "albedo") / of_all)
    if metal is not None:
        _add_metal(add(parent, "bsdf", type="roughconductor"), metal.values, share)


def _add_metal(bsdf: Element, values: dict[str, Any], share: float) -> None:
    add(bsdf, "string", name="distribution", value=str(values["distribution"]))
    add(bsdf, "float", name="alpha", value=f"{values['alpha']:.9g}")
    for name in ("eta", "k"):
        add_numbers(bsdf, "rgb", name, channels(values, name))
    add_numbers(bsdf, "rgb", "specular_reflectance", channels(values, "scale") / share)


def tabulated(layers: Sequence[Layer]) -> NDArray[np.float32]:
    """rho (phi_h, theta_h, theta_d, phi_d, 3) in 1/sr at the places of `grid`.

    Half vectors: theta_h = (i/(n-1))^2 90 degrees, phi_h = 360 l/n (one for all where nothing depends on it); theta_d =
    90 j/(n-1), phi_d = 360 k/n. Below the horizon the table repeats the values just above it, so that it can be
    interpolated up to there.
    """
    shape = TURNED_SHAPE if any(map(is_anisotropic, layers)) else ROUND_SHAPE
    table = np.zeros((*shape, 3), np.float32)
    for turn in range(shape[0]):
        wi, wo = grid(shape, turn)
        value = evaluate_layers(layers, wi.reshape(-1, 3), wo.reshape(-1, 3)).reshape(*shape[1:], 3)
        above = np.minimum(wi[..., 2], wo[..., 2]) > LEAST_COSINE
        table[turn] = _continued(value / np.maximum(wi[..., 2:], LEAST_COSINE), above)
    return table


def grid(shape: Sequence[int], turn: int) -> tuple[Float64Array, Float64Array]:
    """wi and wo (theta_h, theta_d, phi_d, 3) in the local frame, for one azimuth of the half vector."""
    n_turns, n_h, n_d, n_p = shape
    theta_h = (np.linspace(0.0, 1.0, n_h)[:, None, None] ** 2) * (np.pi / 2)
    theta_d = np.linspace(0.0, np.pi / 2, n_d)[None, :, None]
    phi_d = (2.0 * np.pi * np.arange(n_p) / n_p)[None, None, :]
    phi_h = 2.0 * np.pi * turn / n_turns
    cos_h, sin_h, x, y = np.cos(theta_h), np.sin(theta_h), np.cos(phi_h), np.sin(phi_h)
    along = np.sin(theta_d) * np.cos(phi_d)  # in the plane of half vector and normal, away from the normal
    across, up = np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d) + 0.0 * phi_d
    flat = along * cos_h + up * sin_h
    wi = np.stack(np.broadcast_arrays(flat * x - across * y, flat * y + across * x, up * cos_h - along * sin_h), -1)
    half = np.stack(np.broadcast_arrays(sin_h * x, sin_h * y, cos_h + 0.0 * along), -1)
    wo = 2.0 * (wi * half).sum(-1, keepdims=True) * half - wi
    return wi, wo


def _continued(value: Float64Array, above: NDArray[np.bool_]) -> Float64Array:
    """Values (theta_h, theta_d, phi_d, 3); below the horizon the last one above it, theta_d growing, then theta_h."""
    for axis in (1, 0):
        places = np.arange(value.shape[axis]).reshape([-1 if a == axis else 1 for a in range(3)])
        last = np.maximum.accumulate(np.where(above, places, 0), axis=axis)
        value = np.take_along_axis(value, last[..., None], axis)
        above = np.take_along_axis(above, last, axis)
    return np.asarray(value)


def highlight_width(table: NDArray[np.float32]) -> float:
    """The width alpha of GGX by which a table is best sampled: half vectors, cos weighted, have the same median, tan of
    that angle."""
    n_h = table.shape[1]
    theta = (np.linspace(0.0, 1.0, n_h) ** 2) * (np.pi / 2)
    n_facing = max(table.shape[2] // 4, 1)
    density = table[:, :, :n_facing].mean(axis=(0, 2, 3, 4), dtype=np.float64) * np.cos(theta) * np.sin(theta)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(theta))])
    if share[-1] <= 0.0:
        return 1.0
    median = np.interp(0.5 * share[-1], share, theta)
    return float(np.clip(np.tan(median), LEAST_ALPHA, 1.0))
