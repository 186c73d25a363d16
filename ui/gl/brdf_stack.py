"""Layers on the GPU: their curves in a texture, their numbers as uniforms, and passes that evaluate their BRDF.

    layers ─► curves at angles of growing distance (4096, 3) each ─► texture, a row a curve ─┐
          ├─► strengths, quotient parameters ─► uniforms ────────────────────────────────────┼─► any brdf/*.frag.glsl
          └─► their measurements ─► tables (`measured_tables`), as far as they are there ────┘

The curves are the edited ones, with all operators: what a drag changes is a row of 64 KiB.

Their GLSL is brdf(wi, wo) in 1/sr and brdf_cosine(wi, wo) = brdf cos_i, of local directions.

Each layer is f_q rho_q f_o f_A f_B [BenArtzi07, eq. 3.1]: its strength f_q and the numbers of its quotient are
uniforms, its curves rows of a texture (shaders/brdf/curves.glsl); angles and rho_q cos_i are translated by
`python_to_glsl` from the functions that the worker compiles. A measured layer also has a quotient for each channel, of
a table in a texture (`measured_source`). The text depends only on the models, in their order, on which of them
have a curve over the view, and on which share a table: an edit of a curve compiles no shader, nor does a table that
comes.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.material import kinds
from engine.material.layer import Layer
from engine.material.measured import MeasuredModel
from engine.material.model import Model
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.measured_tables import (
    ANGLES,
    MeasuredTables,
    factor_rows,
    n_factor_rows,
    quotient_text,
    table_number,
    value_text,
)
from ui.gl.program import Box, Passes
from ui.gl.python_functions import PythonSource
from ui.gl.python_to_glsl import ForeignFunction, Translation

KERNELS = Path(inspect.getfile(kinds)).with_name("_kernels.py")
INCLUDES = '#include "brdf/arithmetic.glsl"\n#include "brdf/curves.glsl"\n'
MEASURED_INCLUDE = '#include "brdf/measured.glsl"\n'
PAIR = "wi.x, wi.y, wi.z, wo.x, wo.y, wo.z"
# The number of a quotient that is defined in its model's file: any that is not in `kinds`.
OWN_NUMBER = 1 + max(kinds.LAMBERT, kinds.PHONG, kinds.BLINN_PHONG, kinds.COOK_TORRANCE, kinds.ROUGH_CONDUCTOR,
                     kinds.ASHIKHMIN_SHIRLEY, kinds.ASHIKHMIN_SHIRLEY_RATIO)  # fmt: skip


class LayerShape(NamedTuple):
    """What the text of a layer depends on: its model, whether f_o is anything but 1, and the index of its table among
    those of all layers, None where it has none."""

    model: Model
    has_view_curve: bool
    slot: int | None

    @property
    def angles(self) -> tuple[int, ...]:
        """The angles of its curves (`kinds`), in the order of its rows in the texture of curves; f_o comes last."""
        return (*(factor.gamma for factor in self.model.factors), *([kinds.THETA_O] if self.has_view_curve else []))

    @property
    def n_rows(self) -> int:
        """How many rows of the texture of curves it has."""
        return len(self.angles) + (n_factor_rows(self.model) if isinstance(self.model, MeasuredModel) else 0)


@lru_cache(maxsize=64)
def brdf_source(shapes: tuple[LayerShape, ...]) -> str:
    """The text for `#include "generated/brdf.glsl"`. Raises Untranslatable."""
    translation, layers, row = Translation(), [], 0
    slots = [shape.slot for shape in shapes]
    slots_there = sorted({slot for slot in slots if slot is not None})
    values = [_value(translation, slot) for slot in slots_there]
    for place, shape in enumerate(shapes):
        layers.append(_layer(translation, place, shape, row))
        row += shape.n_rows
    total = " + ".join(_call(place, slot) for place, slot in enumerate(slots)) or "vec3(0.0)"
    looked_up = [f"    Measured m{slot} = value_{slot}(wi, wo);" for slot in slots_there]
    return "\n".join([
        INCLUDES + (MEASURED_INCLUDE if values else ""), translation.text, *values, *layers,
        "vec3 brdf_cosine(vec3 wi, vec3 wo) {", *looked_up, f"    return {total};", "}", "",
        f"vec3 brdf(vec3 wi, vec3 wo) {{\n    return brdf_cosine(wi, wo) / max(wi.z, {kinds.GRAZING!r});\n}}\n",
    ])  # fmt: skip


def _call(place: int, slot: int | None) -> str:
    return f"layer_{place}(wi, wo)" if slot is None else f"layer_{place}(m{slot}, wi, wo)"


def _layer(translation: Translation, place: int, shape: LayerShape, row: int) -> str:
    """f_q rho_q cos_i f_A f_B f_o of one layer, whose first curve is in that row."""
    numbers, model, slot = f"quotient_parameters_{place}", shape.model, shape.slot
    terms = [f"strength_{place}", f"{_quotient(translation, model)}({numbers}, {PAIR})"]
    measured, given = [], ""
    if isinstance(model, MeasuredModel) and slot is not None:
        angles = [ANGLES[gamma] for gamma in shape.angles]
        measured, given = [quotient_text(model, place, row + len(angles))], "Measured m, "
        terms.append(f"measured_{place}(m)")
    else:
        angles = [_angle(translation, gamma, numbers) for gamma in shape.angles]
    terms += [f"curve_at({row + further}, {angle})" for further, angle in enumerate(angles)]
    return "\n".join([
        f"uniform vec3 strength_{place};", f"uniform mat2x4 {numbers};", *measured,
        f"vec3 layer_{place}({given}vec3 wi, vec3 wo) {{",
        "    return " + "\n        * ".join(terms) + ";", "}", "",
    ])  # fmt: skip


def _value(translation: Translation, slot: int) -> str:
    """The look-up of a table."""
    phi_d = translation.function(_kernels(), "phi_d", {}, {})
    angles = {kind: _angle(translation, kind, "mat2x4(0.0)") for kind in ANGLES}
    return value_text(slot, angles, f"{phi_d}({PAIR})")


def _angle(translation: Translation, kind: int, numbers: str) -> str:
    """The call that computes an angle of the pair of directions."""
    return f"{translation.function(_kernels(), 'gamma', {'kind': kind}, {})}({numbers}, {PAIR})"


def _quotient(translation: Translation, model: Model) -> str:
    """The name of the function that is rho_q cos_i of a model."""
    number, foreign = model.kind, {}
    if model.quotient is not None:
        own = PythonSource.read(Path(inspect.getfile(model.quotient)))
        number, foreign = OWN_NUMBER, {"_call": ForeignFunction(own, model.quotient.__qualname__, skipped=1)}
    return translation.function(_kernels(), "quotient_cosine", {"model_kind": number}, foreign)


@lru_cache(maxsize=1)
def _kernels() -> PythonSource:
    return PythonSource.read(KERNELS)


# ------------------------------------------------------------------------------------------------- the stack on the GPU


N_SAMPLES = 4096
# The angles of a curve's samples, radians; `place` in shaders/brdf/curves.glsl is the inverse.
SAMPLED_AT = (np.arange(N_SAMPLES) / (N_SAMPLES - 1.0)) ** 2 * (np.pi / 2)
LARGEST = 3e38
PAIRS_A_ROW = 1024


class BrdfStack:
    """Some layers whose BRDFs are added, as shaders see them. `set_layers` first, then any number of passes.

    Measured layers are only the product of their curves while `tables` (None: no tables) does not have theirs.
    """

    def __init__(self, passes: Passes, memory: TextureMemory, tables: MeasuredTables | None = None) -> None:
        self._passes, self._memory = passes, memory
        self._tables, self._has_own_tables = tables or MeasuredTables(memory), tables is None
        self._curves: moderngl.Texture | None = None
        self.layers: tuple[Layer, ...] = ()

    def set_layers(self, layers: tuple[Layer, ...]) -> bool:
        """Follow the layers; returns whether they differ from those before."""
        if layers == self.layers and self._curves is not None:
            return False
        rows = [row for layer in layers for row in _uploaded_rows(layer)]
        texels = np.zeros((max(len(rows), 1), N_SAMPLES, 4), np.float32)
        for row, values in enumerate(rows):
            texels[row, :, :3] = np.minimum(values, LARGEST)
        if self._curves is None or self._curves.height != len(texels):
            self._memory.release(self._curves)
            self._curves = self._memory.texture((N_SAMPLES, len(texels)), 4, "f4")
        self._curves.write(texels.tobytes())
        self.layers = layers
        return True

    def draw(
        self,
        fragment: str,
        target: moderngl.Framebuffer,
        box: Box,
        textures: Mapping[str, moderngl.Texture] | None = None,
        *,
        add: bool = False,
        **uniforms: Any,
    ) -> None:
        """Run `brdf/fragment` over a box of the target; see `Passes.draw`. Raises GraphicsError, Untranslatable."""
        program = self._passes.full_screen(f"brdf/{fragment}", self.source)
        numbers = uniforms | self.numbers()
        there = {name: value for name, value in numbers.items() if name in program}
        used = {**self.textures(), **(textures or {})}
        self._passes.draw(program, target, box, {n: t for n, t in used.items() if n in program}, add=add, **there)

    @property
    def source(self) -> dict[str, str]:
        """The text that a program includes. Raises Untranslatable."""
        shapes = [LayerShape(layer.model, layer.has_view_curve, slot)
                  for layer, slot in zip(self.layers, self._slots()[0], strict=True)]  # fmt: skip
        return {"generated/brdf.glsl": brdf_source(tuple(shapes))}

    def textures(self) -> dict[str, moderngl.Texture | moderngl.TextureArray]:
        """The textures of that program, by their uniforms' names."""
        assert self._curves is not None
        return {"curves": self._curves, **self._slots()[1]}

    def numbers(self) -> dict[str, tuple[float, ...]]:
        """Its other uniforms."""
        numbers: dict[str, tuple[float, ...]] = {}
        for place, layer in enumerate(self.layers):
            numbers[f"strength_{place}"] = tuple(layer.scale().tolist())
            numbers[f"quotient_parameters_{place}"] = tuple(layer.quotient_parameters().tolist())
        return numbers

    def evaluate(self, wi: NDArray[np.floating], wo: NDArray[np.floating]) -> NDArray[np.float64]:
        """The BRDF of unit directions (N, 3) in the local frame, (N, 3) in 1/sr; waits for the GPU."""
        n = len(wi)
        size = (min(n, PAIRS_A_ROW), -(-n // PAIRS_A_ROW))
        directions = np.zeros((2, size[0] * size[1], 4), np.float32)
        directions[:, :n, :3] = wi, wo
        there = [self._memory.texture(size, 4, "f4", each) for each in directions]
        result = self._memory.texture(size, 4, "f4")
        target = self._memory.framebuffer([result])
        names = ("towards_light", "towards_eye")
        try:
            self.draw("pairs.frag.glsl", target, (0, 0, *size), dict(zip(names, there, strict=True)))
            return read_texture(result, np.float32).reshape(-1, 4)[:n, :3].astype(np.float64)
        finally:
            self._memory.release_framebuffer(target)
            for texture in (*there, result):
                self._memory.release(texture)

    def release(self) -> None:
        """Free the texture; programs stay with the passes."""
        self._memory.release(self._curves)
        if self._has_own_tables:
            self._tables.release()
        self._curves, self.layers = None, ()

    def _slots(self) -> tuple[tuple[int | None, ...], dict[str, moderngl.TextureArray]]:
        """Which table each layer reads, and the textures by their uniforms' names."""
        numbers = [table_number(layer) for layer in self.layers]
        there = list(dict.fromkeys(each for each in numbers if each is not None))
        slots = tuple(None if each is None else there.index(each) for each in numbers)
        return slots, {f"table_{slot}": self._tables.texture(each) for slot, each in enumerate(there)}


def _uploaded_rows(layer: Layer) -> list[NDArray[np.float64]]:
    """The curves of a layer, and those that its quotient is computed from, (N_SAMPLES, 3) each."""
    curves = [layer.curve(factor.name)(SAMPLED_AT) for factor in layer.model.factors]
    if layer.has_view_curve:
        curves.append(layer.view_curve(SAMPLED_AT))
    return curves + factor_rows(layer, SAMPLED_AT)
