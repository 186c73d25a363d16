"""The GLSL of a measured layer's quotient: computed at the look-up, from the measurement and its factors.

    table of samples ─► shaders/brdf/measured.glsl ─┐
    factors as fitted ─► rows of the curves' texture ┴─► quotient per channel, as material._measured_kernels has it

All parts of a measurement share one look-up. The factors are sampled like the layer's own curves, so that an unedited
layer equals the measurement to the last digits of single precision, at the factors' bends as well.

Tables of measurements are array textures of 180 x 90 x 90 samples, RGB, for brdf/measured.glsl. Single precision, 17.5
MB each: values may be as bright as a mirror's, beyond the range of half floats, and what is above a diffuse part is a
difference; half floats save 9 MB and no time. A table is uploaded in pieces, a few ms a frame, and is used once it is
complete. The last used ones stay.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.material import kinds
from engine.material.layer import Layer
from engine.material.measured import MeasuredModel, measurement_of
from engine.material.model import number
from engine.measured.measurement import Measurement, Part
from ui.gl.gpu_memory import TextureMemory

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class Product:
    """Factors of a measurement by name with the angles they are over, and the strength they are multiplied by."""

    strength: Part
    factors: tuple[tuple[str, int], ...]


DIFFUSE_PRODUCT = Product("diffuse", (("theta_i", kinds.THETA_I), ("theta_o", kinds.THETA_O)))
CLOTH_PRODUCT = Product("whole", (("p", kinds.THETA_I), ("q", kinds.THETA_H), ("p", kinds.THETA_O)))
HIGHLIGHT_PRODUCTS = (
    Product("specular", (("theta_d", kinds.THETA_D), ("theta_h", kinds.THETA_H), ("s", kinds.THETA_O))),
    Product("around", (("theta_h", kinds.THETA_H), ("phi_h", kinds.PHI_H))),
    Product("twist", (("theta_h", kinds.THETA_H), ("phi_d", kinds.PHI_D))),
    Product("brushed", (("theta_u", kinds.SLOPE_U), ("theta_v", kinds.SLOPE_V))),
)
PRODUCTS: dict[Part, tuple[Product, ...]] = {
    "diffuse": (DIFFUSE_PRODUCT,),
    "whole": (CLOTH_PRODUCT,),
    **{product.strength: (DIFFUSE_PRODUCT, product) for product in HIGHLIGHT_PRODUCTS},
}


# The angles in a `Measured`, by kind, in the order of its fields.
ANGLES = {
    kinds.THETA_I: "m.theta_i", kinds.THETA_O: "m.theta_o", kinds.THETA_H: "m.theta_h", kinds.THETA_D: "m.theta_d",
    kinds.PHI_H: "m.phi_h", kinds.PHI_D: "m.phi_d", kinds.SLOPE_U: "m.theta_u", kinds.SLOPE_V: "m.theta_v",
}  # fmt: skip


def table_number(layer: Layer) -> int | None:
    """The number that names the table of a layer; 0 where its file was not read, None for one that is not measured."""
    return measurement_of(layer.values).number if isinstance(layer.model, MeasuredModel) else None


def n_factor_rows(model: MeasuredModel) -> int:
    """How many rows of the curves' texture the quotient has."""
    return sum(len(product.factors) for product in PRODUCTS[model.part])


def factor_rows(layer: Layer, gamma: Float64Array) -> list[Float64Array]:
    """Those rows, (N, 3) each, at angles (N,); the first of each product includes its strength. None of other
    layers."""
    if not isinstance(layer.model, MeasuredModel):
        return []
    measurement, smoothing = measurement_of(layer.values), number(layer.values, "smoothing")
    return [row for product in PRODUCTS[layer.model.part] for row in _rows(product, measurement, smoothing, gamma)]


def value_text(slot: int, angles: Mapping[int, str], phi_d: str) -> str:
    """The function value_SLOT(wi, wo), a `Measured`; a table of a single texel means that there is none. One look-up
    serves all layers of a file. angles, by kind, and phi_d: calls that compute them."""
    there = ", ".join(angles[kind] for kind in ANGLES)
    return "\n".join([
        f"uniform sampler2DArray table_{slot};",
        f"Measured value_{slot}(vec3 wi, vec3 wo) {{",
        f"    Measured m = Measured(vec3(-1.0), {there});",
        f"    if (textureSize(table_{slot}, 0).x > 1) {{",
        f"        m.value = measured_sample(table_{slot}, m.theta_h, m.theta_d, {phi_d});", "    }",
        "    return m;", "}", "",
    ])  # fmt: skip


def quotient_text(model: MeasuredModel, place: int, row: int) -> str:
    """The function measured_PLACE(m), whose factors begin in that row: 1 where there is no value."""
    products = []
    for product in PRODUCTS[model.part]:
        terms = [f"curve_at({row + i}, {ANGLES[kind]})" for i, (_, kind) in enumerate(product.factors)]
        products.append(" * ".join(terms))
        row += len(terms)
    kind = model.part if model.part in ("diffuse", "whole") else "specular"
    quotient = f"{kind}_quotient({', '.join(['m.value', *products])})"
    return "\n".join([
        f"vec3 measured_{place}(Measured m) {{", f"    return m.value.x < 0.0 ? vec3(1.0) : {quotient};", "}", "",
    ])  # fmt: skip


def _rows(product: Product, measurement: Measurement, smoothing: float, gamma: Float64Array) -> list[Float64Array]:
    rows = [measurement.curve(name, gamma, smoothing) for name, _ in product.factors]
    return [rows[0] * measurement.strength(product.strength), *rows[1:]]


# ---------------------------------------------------------------------------------------------------- tables on the GPU


# Tables that stay besides those that are in use.
MOST_KEPT = 4
LAYERS_AT_ONCE = 5


class MeasuredTables:
    """The tables of one context, by the numbers that name measurements."""

    def __init__(self, memory: TextureMemory) -> None:
        self._memory = memory
        self._whole: dict[int, moderngl.TextureArray] = {}  # in the order of use, the last one at the end
        self._coming: _Upload | None = None
        self._blank: moderngl.TextureArray | None = None

    def __contains__(self, number: int) -> bool:
        return number in self._whole

    @property
    def is_uploading(self) -> bool:
        """Whether a table is under way."""
        return self._coming is not None

    def texture(self, number: int) -> moderngl.TextureArray:
        """The table of that number; a single texel where it is not there."""
        if number in self._whole:
            self._whole[number] = self._whole.pop(number)
            return self._whole[number]
        if self._blank is None:
            self._blank = self._memory.texture_array((1, 1, 1), 3, "f4")
        return self._blank

    def begin(self, number: int, samples: NDArray[np.float32]) -> None:
        """Make room for a table (90, 90, 180, 3); `step` uploads it. Raises GraphicsError."""
        n_h, n_d, n_phi, _ = samples.shape
        self._coming = _Upload(number, samples, self._memory.texture_array((n_phi, n_d, n_h), 3, "f4"))

    def step(self, seconds: float) -> bool:
        """Continue the upload under way, for about so long; returns whether it is complete."""
        upload, until = self._coming, time.perf_counter() + seconds
        if upload is None:
            return False
        while not upload.is_done:
            upload.step()
            if time.perf_counter() >= until:
                break
        if upload.is_done:
            self._whole[upload.number], self._coming = upload.texture, None
        return upload.is_done

    def forget_but(self, used: Collection[int]) -> None:
        """Free the least recently used tables beyond `MOST_KEPT`, except those in use."""
        spare = [table for table in self._whole if table not in used]
        for oldest in spare[: max(0, len(spare) - MOST_KEPT)]:
            self._memory.release(self._whole.pop(oldest))

    def release(self) -> None:
        """Free all."""
        coming = None if self._coming is None else self._coming.texture
        for texture in (*self._whole.values(), self._blank, coming):
            self._memory.release(texture)
        self._whole, self._coming, self._blank = {}, None, None


class _Upload:
    """A table that is being uploaded: so many of its layers are there."""

    def __init__(self, number: int, samples: NDArray[np.float32], texture: moderngl.TextureArray) -> None:
        self.number, self.texture = number, texture
        self._samples, self._n_done = samples, 0

    @property
    def is_done(self) -> bool:
        return self._n_done == len(self._samples)

    def step(self) -> None:
        piece = np.ascontiguousarray(self._samples[self._n_done : self._n_done + LAYERS_AT_ONCE], np.float32)
        box = (0, 0, self._n_done, self.texture.width, self.texture.height, len(piece))
        self.texture.write(piece, viewport=box, alignment=1)
        self._n_done += len(piece)
