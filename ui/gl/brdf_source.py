"""The GLSL of a stack of layers: brdf(wi, wo) in 1/sr and brdf_cosine(wi, wo) = brdf cos_i, of local directions.

Each layer is f_q rho_q f_o f_A f_B [BenArtzi07, eq. 3.1]: its strength f_q and the numbers of its quotient are
uniforms, its curves rows of a texture (shaders/brdf/curves.glsl), angles and rho_q cos_i what `python_to_glsl` makes of
the functions that the worker compiles. A text depends on the models alone, in their order: no edit compiles a shader.

A quotient that differs between channels (a table of measurements) would come in at `_layer`: the product there is of
vec3, so that its factor may be a look-up in a texture of its own.
"""

from __future__ import annotations

import inspect
from functools import lru_cache
from pathlib import Path

from engine.material import kinds
from engine.material.model import Factor, Model
from ui.gl.python_source import PythonSource
from ui.gl.python_to_glsl import Foreign, Translation

KERNELS = Path(inspect.getfile(kinds)).with_name("_kernels.py")
INCLUDES = '#include "brdf/arithmetic.glsl"\n#include "brdf/curves.glsl"\n'
# By any other number than those in `kinds` kernels know a quotient that stands in its model's file.
OWN_NUMBER = 1 + max(kinds.LAMBERT, kinds.PHONG, kinds.BLINN_PHONG, kinds.COOK_TORRANCE, kinds.ROUGH_CONDUCTOR,
                     kinds.ASHIKHMIN_SHIRLEY, kinds.ASHIKHMIN_SHIRLEY_RATIO)  # fmt: skip


def curves_of(model: Model) -> tuple[Factor, ...]:
    """All factors of a model, in the order of its rows in the texture of curves."""
    return model.factors if model.view_factor is None else (*model.factors, model.view_factor)


@lru_cache(maxsize=64)
def brdf_source(models: tuple[Model, ...]) -> str:
    """What `#include "generated/brdf.glsl"` stands for. Raises Untranslatable."""
    translation, layers, row = Translation(), [], 0
    for place, model in enumerate(models):
        layers.append(_layer(translation, place, model, row))
        row += len(curves_of(model))
    total = " + ".join(f"layer_{place}(wi, wo)" for place in range(len(models))) or "vec3(0.0)"
    return "\n".join([
        INCLUDES, translation.text, *layers,
        f"vec3 brdf_cosine(vec3 wi, vec3 wo) {{\n    return {total};\n}}\n",
        f"vec3 brdf(vec3 wi, vec3 wo) {{\n    return brdf_cosine(wi, wo) / max(wi.z, {kinds.GRAZING!r});\n}}\n",
    ])  # fmt: skip


def _layer(translation: Translation, place: int, model: Model, row: int) -> str:
    """f_q rho_q cos_i f_A f_B f_o of one layer, whose first curve is that row."""
    numbers, pair = f"quotient_parameters_{place}", "wi.x, wi.y, wi.z, wo.x, wo.y, wo.z"
    terms = [f"strength_{place}", f"{_quotient(translation, model)}({numbers}, {pair})"]
    for further, factor in enumerate(curves_of(model)):
        angle = translation.function(_kernels(), "gamma", {"kind": factor.gamma}, {})
        terms.append(f"curve_at({row + further}, {angle}({numbers}, {pair}))")
    return "\n".join([
        f"uniform vec3 strength_{place};", f"uniform mat2x4 {numbers};",
        f"vec3 layer_{place}(vec3 wi, vec3 wo) {{",
        "    return " + "\n        * ".join(terms) + ";", "}", "",
    ])  # fmt: skip


def _quotient(translation: Translation, model: Model) -> str:
    """The name of the function that is rho_q cos_i of a model."""
    number, foreign = model.kind, {}
    if model.quotient is not None:
        own = PythonSource.read(Path(inspect.getfile(model.quotient)))
        number, foreign = OWN_NUMBER, {"_call": Foreign(own, model.quotient.__qualname__, skipped=1)}
    return translation.function(_kernels(), "quotient_cosine", {"model_kind": number}, foreign)


@lru_cache(maxsize=1)
def _kernels() -> PythonSource:
    return PythonSource.read(KERNELS)
