"""The GLSL of a stack of layers: brdf(wi, wo) in 1/sr and brdf_cosine(wi, wo) = brdf cos_i, of local directions.

Each layer is f_q rho_q f_o f_A f_B [BenArtzi07, eq. 3.1]: its strength f_q and the numbers of its quotient are
uniforms, its curves rows of a texture (shaders/brdf/curves.glsl); angles and rho_q cos_i are translated by
`python_to_glsl` from the functions that the worker compiles. A measured layer also has a quotient for each channel, of
a table in a texture (`measured_source`). The text depends only on the models, in their order, and on which of them
share a table: no edit compiles a shader, nor does a table that comes.
"""

from __future__ import annotations

import inspect
from functools import lru_cache
from pathlib import Path

from engine.material import kinds
from engine.material.measured import MeasuredModel
from engine.material.model import Factor, Model
from ui.gl.measured_source import ANGLES, n_factor_rows, quotient_text, value_text
from ui.gl.python_functions import PythonSource
from ui.gl.python_to_glsl import ForeignFunction, Translation

KERNELS = Path(inspect.getfile(kinds)).with_name("_kernels.py")
MEASURED_KERNELS = Path(inspect.getfile(MeasuredModel)).with_name("_measured_kernels.py")
INCLUDES = '#include "brdf/arithmetic.glsl"\n#include "brdf/curves.glsl"\n'
MEASURED_INCLUDE = '#include "brdf/measured.glsl"\n'
PAIR = "wi.x, wi.y, wi.z, wo.x, wo.y, wo.z"
# The number of a quotient that is defined in its model's file: any that is not in `kinds`.
OWN_NUMBER = 1 + max(kinds.LAMBERT, kinds.PHONG, kinds.BLINN_PHONG, kinds.COOK_TORRANCE, kinds.ROUGH_CONDUCTOR,
                     kinds.ASHIKHMIN_SHIRLEY, kinds.ASHIKHMIN_SHIRLEY_RATIO)  # fmt: skip


def curves_of(model: Model) -> tuple[Factor, ...]:
    """All factors of a model, in the order of its rows in the texture of curves."""
    return model.factors if model.view_factor is None else (*model.factors, model.view_factor)


def rows_of(model: Model) -> int:
    """How many rows of the texture of curves a layer of this model has."""
    return len(curves_of(model)) + (n_factor_rows(model) if isinstance(model, MeasuredModel) else 0)


@lru_cache(maxsize=64)
def brdf_source(models: tuple[Model, ...], slots: tuple[int | None, ...]) -> str:
    """The text for `#include "generated/brdf.glsl"`. slots: of each layer the index of its table among those of all
    layers, None where it has none. Raises Untranslatable."""
    translation, layers, row = Translation(), [], 0
    slots_there = sorted({slot for slot in slots if slot is not None})
    values = [_value(translation, slot) for slot in slots_there]
    for place, (model, slot) in enumerate(zip(models, slots, strict=True)):
        layers.append(_layer(translation, place, model, row, slot))
        row += rows_of(model)
    total = " + ".join(_call(place, slot) for place, slot in enumerate(slots)) or "vec3(0.0)"
    looked_up = [f"    Measured m{slot} = value_{slot}(wi, wo);" for slot in slots_there]
    return "\n".join([
        INCLUDES + (MEASURED_INCLUDE if values else ""), translation.text, *values, *layers,
        "vec3 brdf_cosine(vec3 wi, vec3 wo) {", *looked_up, f"    return {total};", "}", "",
        f"vec3 brdf(vec3 wi, vec3 wo) {{\n    return brdf_cosine(wi, wo) / max(wi.z, {kinds.GRAZING!r});\n}}\n",
    ])  # fmt: skip


def _call(place: int, slot: int | None) -> str:
    return f"layer_{place}(wi, wo)" if slot is None else f"layer_{place}(m{slot}, wi, wo)"


def _layer(translation: Translation, place: int, model: Model, row: int, slot: int | None) -> str:
    """f_q rho_q cos_i f_A f_B f_o of one layer, whose first curve is in that row."""
    numbers, curves = f"quotient_parameters_{place}", curves_of(model)
    terms = [f"strength_{place}", f"{_quotient(translation, model)}({numbers}, {PAIR})"]
    measured, given = [], ""
    if isinstance(model, MeasuredModel) and slot is not None:
        angles = [ANGLES[factor.gamma] for factor in curves]
        measured, given = [quotient_text(model, place, row + len(curves))], "Measured m, "
        terms.append(f"measured_{place}(m)")
    else:
        angles = [_angle(translation, factor.gamma, numbers) for factor in curves]
    terms += [f"curve_at({row + further}, {angle})" for further, angle in enumerate(angles)]
    return "\n".join([
        f"uniform vec3 strength_{place};", f"uniform mat2x4 {numbers};", *measured,
        f"vec3 layer_{place}({given}vec3 wi, vec3 wo) {{",
        "    return " + "\n        * ".join(terms) + ";", "}", "",
    ])  # fmt: skip


def _value(translation: Translation, slot: int) -> str:
    """The look-up of a table."""
    foreign = {"_angle": ForeignFunction(_kernels(), "_angle")}
    phi_d = translation.function(_measured_kernels(), "_phi_d", {}, foreign)
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


@lru_cache(maxsize=1)
def _measured_kernels() -> PythonSource:
    return PythonSource.read(MEASURED_KERNELS)
