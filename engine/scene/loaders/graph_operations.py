"""The arithmetic of MaterialX's nodes [MaterialX, Standard Nodes], on arrays (N, C).

A function has the names of its node's inputs, `in_` for `in`; a number with one channel counts for all. Nodes that
MaterialX itself defines by networks of these are not here (`engine.scene.loaders.mtlx_library`).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from engine.scene.loaders.graph_fields import Array

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
_TINY = np.float32(1e-30)


def _alpha(colour: Array) -> Array:
    return colour[:, 3:4] if colour.shape[1] == 4 else np.ones_like(colour[:, :1])


def _mixed(bg: Array, found: Array, mix: Array) -> Array:
    return bg * (1.0 - mix) + found * mix


def _divided(one: Array, other: Array) -> Array:
    return np.asarray(np.where(other != 0.0, one / np.where(other != 0.0, other, 1.0), 0.0))


def remap(in_: Array, inlow: Array, inhigh: Array, outlow: Array, outhigh: Array) -> Array:
    return outlow + _divided(in_ - inlow, inhigh - inlow) * (outhigh - outlow)


def smoothstep(in_: Array, low: Array, high: Array) -> Array:
    t = np.clip(_divided(in_ - low, high - low), 0.0, 1.0)
    return np.where(high > low, t * t * (3.0 - 2.0 * t), in_ >= high)


def luminance(in_: Array, lumacoeffs: Array) -> Array:
    grey = np.repeat((in_[:, :3] * lumacoeffs[:, :3]).sum(axis=1, keepdims=True), 3, axis=1)
    return np.concatenate([grey, in_[:, 3:]], axis=1)


def rgb_to_hsv(in_: Array) -> Array:
    """Hue, saturation and value, all in [0, 1] for colours there."""
    high, low = in_[:, :3].max(axis=1), in_[:, :3].min(axis=1)
    spread = high - low
    red, green, blue = in_[:, 0], in_[:, 1], in_[:, 2]
    hue = np.where(
        red >= high, green - blue, np.where(green >= high, 2.0 * spread + blue - red, 4.0 * spread + red - green)
    )
    hue = np.mod(_divided(hue, 6.0 * spread), 1.0)
    saturation = np.where(high > 0.0, _divided(spread, high), 0.0)
    return np.concatenate([np.stack([hue, saturation, high], axis=1), in_[:, 3:]], axis=1)


def hsv_to_rgb(in_: Array) -> Array:
    """The inverse."""
    hue, saturation, value = in_[:, 0], in_[:, 1], in_[:, 2]
    sixths = np.mod(hue[:, None] * 6.0 + np.array([0.0, 4.0, 2.0], np.float32), 6.0)
    share = np.clip(np.abs(sixths - 3.0) - 1.0, 0.0, 1.0)
    rgb = value[:, None] * (1.0 - saturation[:, None] * (1.0 - share))
    return np.concatenate([rgb, in_[:, 3:]], axis=1)


def rotate2d(in_: Array, amount: Array) -> Array:
    """Turned clockwise by degrees, as in MaterialX."""
    angle = np.radians(amount)
    cosine, sine = np.cos(angle)[:, 0], np.sin(angle)[:, 0]
    return np.stack([cosine * in_[:, 0] + sine * in_[:, 1], cosine * in_[:, 1] - sine * in_[:, 0]], axis=1)


def rotate3d(in_: Array, amount: Array, axis: Array) -> Array:
    """Turned about an axis by degrees, clockwise as seen from its tip [MaterialX; Rodrigues' formula]."""
    if not in_.shape[1] == axis.shape[1] == 3:
        raise ValueError("vectors of other than three numbers have no axis")
    axis, angle = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), _TINY), np.radians(amount)
    along = axis * (axis * in_).sum(axis=1, keepdims=True)
    return in_ * np.cos(angle) + np.cross(in_, axis) * np.sin(angle) + along * (1.0 - np.cos(angle))


def combine(**channels: Array) -> Array:
    return np.concatenate([*channels.values()], axis=1)


def extract(in_: Array, index: Array) -> Array:
    k = int(np.clip(index.flat[0], 0, in_.shape[1] - 1))
    return in_[:, k : k + 1]


def cross_product(in1: Array, in2: Array) -> Array:
    if not in1.shape[1] == in2.shape[1] == 3:
        raise ValueError("vectors of other than three numbers have no cross product")
    return np.cross(in1, in2)


def burn(fg: Array, bg: Array, mix: Array) -> Array:
    return _mixed(bg, np.where(np.abs(fg) < 1e-8, 0.0, 1.0 - _divided(1.0 - bg, fg)), mix)


def dodge(fg: Array, bg: Array, mix: Array) -> Array:
    return _mixed(bg, _divided(bg, 1.0 - fg), mix)


def overlay(fg: Array, bg: Array, mix: Array) -> Array:
    return _mixed(bg, np.where(bg < 0.5, 2.0 * fg * bg, 1.0 - 2.0 * (1.0 - fg) * (1.0 - bg)), mix)


def premultiply(in_: Array) -> Array:
    return np.concatenate([in_[:, :3] * in_[:, 3:], in_[:, 3:]], axis=1)


def unpremultiply(in_: Array) -> Array:
    return np.concatenate(
        [np.where(in_[:, 3:] != 0.0, _divided(in_[:, :3], in_[:, 3:]), in_[:, :3]), in_[:, 3:]], axis=1
    )


def ramp(texcoord: Array, valuel: Array, valuer: Array) -> Array:
    return _mixed(valuel, valuer, np.clip(texcoord[:, :1], 0.0, 1.0))


def ramp_upwards(texcoord: Array, valuet: Array, valueb: Array) -> Array:
    """v grows upwards: the bottom's value at 0."""
    return _mixed(valueb, valuet, np.clip(texcoord[:, 1:2], 0.0, 1.0))


def split(texcoord: Array, valuel: Array, valuer: Array, center: Array) -> Array:
    return np.where(texcoord[:, :1] >= center, valuer, valuel)


def split_upwards(texcoord: Array, valuet: Array, valueb: Array, center: Array) -> Array:
    return np.where(texcoord[:, 1:2] >= center, valuet, valueb)


def switch(which: Array, **inputs: Array) -> Array:
    """in1 … in10 by `which`, from 0, of those that there are."""
    values = list(inputs.values())
    chosen = np.clip(np.floor(which), 0, len(values) - 1)
    found = np.zeros_like(values[0])
    for k, each in enumerate(values):
        found = np.where(chosen == k, each, found)
    return found


def chosen(is_met: Array, **inputs: Array) -> Array:
    """in1 where a condition is met, else in2; without these the condition itself."""
    return np.where(is_met, inputs["in1"], inputs["in2"]) if {"in1", "in2"} <= inputs.keys() else np.asarray(is_met)


def transform(in_: Array, mat: Array) -> Array:
    """A row of numbers times a matrix; of four numbers the last is 1 where there are but three."""
    side = 3 if mat.shape[1] == 9 else 4
    matrices = mat.reshape(len(mat), side, side)
    n = in_.shape[1]
    rows = np.concatenate([in_, np.ones((len(in_), side - n), np.float32)], axis=1)
    return np.einsum("ni,nij->nj", rows, matrices)[:, :n]


def normal_map(in_: Array, scale: Array) -> Array:
    """A normal in the surface's own frame, from its colours."""
    vectors = np.where((in_ == 0.0).all(axis=1, keepdims=True), np.array([0.0, 0.0, 1.0], np.float32), in_ * 2.0 - 1.0)
    scaled = np.concatenate([vectors[:, :2] * scale[:, :1], vectors[:, 2:]], axis=1)
    return scaled / np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), _TINY)


def safe_power(in1: Array, in2: Array) -> Array:
    return np.sign(in1) * np.abs(in1) ** in2


OPERATIONS: dict[str, Callable[..., Any]] = {
    "constant": lambda value: value,
    "dot": lambda in_: in_,
    "add": lambda in1, in2: in1 + in2,
    "subtract": lambda in1, in2: in1 - in2,
    "multiply": lambda in1, in2: in1 * in2,
    "divide": lambda in1, in2: _divided(in1, in2),
    "modulo": lambda in1, in2: np.where(in2 != 0.0, in1 - in2 * np.floor(_divided(in1, in2)), 0.0),
    "fract": lambda in_: in_ - np.floor(in_),
    "invert": lambda in_, amount: amount - in_,
    "absval": lambda in_: np.abs(in_),
    "sign": lambda in_: np.sign(in_),
    "floor": lambda in_: np.floor(in_),
    "ceil": lambda in_: np.ceil(in_),
    "round": lambda in_: np.floor(in_ + 0.5),
    "power": lambda in1, in2: in1**in2,
    "safepower": safe_power,
    "sin": lambda in_: np.sin(in_),
    "cos": lambda in_: np.cos(in_),
    "tan": lambda in_: np.tan(in_),
    "asin": lambda in_: np.arcsin(np.clip(in_, -1.0, 1.0)),
    "acos": lambda in_: np.arccos(np.clip(in_, -1.0, 1.0)),
    "atan2": lambda iny, inx: np.arctan2(iny, inx),
    "sqrt": lambda in_: np.sqrt(np.maximum(in_, 0.0)),
    "ln": lambda in_: np.log(np.maximum(in_, _TINY)),
    "exp": lambda in_: np.exp(np.minimum(in_, 80.0)),
    "trianglewave": lambda in_: np.abs(in_ - 2.0 * np.floor(0.5 * in_ + 0.5)),
    "min": lambda in1, in2: np.minimum(in1, in2),
    "max": lambda in1, in2: np.maximum(in1, in2),
    "clamp": lambda in_, low, high: np.minimum(np.maximum(in_, low), high),
    "normalize": lambda in_: in_ / np.maximum(np.linalg.norm(in_, axis=1, keepdims=True), _TINY),
    "magnitude": lambda in_: np.linalg.norm(in_, axis=1, keepdims=True),
    "distance": lambda in1, in2: np.linalg.norm(in1 - in2, axis=1, keepdims=True),
    "dotproduct": lambda in1, in2: (in1 * in2).sum(axis=1, keepdims=True),
    "crossproduct": cross_product,
    "rotate2d": rotate2d,
    "rotate3d": rotate3d,
    "remap": remap,
    "smoothstep": smoothstep,
    "luminance": luminance,
    "rgbtohsv": rgb_to_hsv,
    "hsvtorgb": hsv_to_rgb,
    "combine2": combine,
    "combine3": combine,
    "combine4": combine,
    "extract": extract,
    "mix": lambda fg, bg, mix: _mixed(bg, fg, mix),
    "plus": lambda fg, bg, mix: _mixed(bg, bg + fg, mix),
    "minus": lambda fg, bg, mix: _mixed(bg, bg - fg, mix),
    "difference": lambda fg, bg, mix: _mixed(bg, np.abs(bg - fg), mix),
    "screen": lambda fg, bg, mix: _mixed(bg, 1.0 - (1.0 - fg) * (1.0 - bg), mix),
    "burn": burn,
    "dodge": dodge,
    "overlay": overlay,
    "premult": premultiply,
    "unpremult": unpremultiply,
    "inside": lambda in_, mask: in_ * mask,
    "outside": lambda in_, mask: in_ * (1.0 - mask),
    "over": lambda fg, bg, mix: _mixed(bg, fg + bg * (1.0 - _alpha(fg)), mix),
    "in": lambda fg, bg, mix: _mixed(bg, fg * _alpha(bg), mix),
    "out": lambda fg, bg, mix: _mixed(bg, fg * (1.0 - _alpha(bg)), mix),
    "mask": lambda fg, bg, mix: _mixed(bg, bg * _alpha(fg), mix),
    "matte": lambda fg, bg, mix: _mixed(
        bg,
        np.concatenate(
            [(fg * _alpha(fg) + bg * (1.0 - _alpha(fg)))[:, :3], _alpha(fg) + _alpha(bg) * (1.0 - _alpha(fg))], axis=1
        ),
        mix,
    ),
    "ramplr": ramp,
    "ramptb": ramp_upwards,
    "splitlr": split,
    "splittb": split_upwards,
    "ifgreater": lambda value1, value2, **inputs: chosen(value1 > value2, **inputs),
    "ifgreatereq": lambda value1, value2, **inputs: chosen(value1 >= value2, **inputs),
    "ifequal": lambda value1, value2, **inputs: chosen(value1 == value2, **inputs),
    "and": lambda in1, in2: (in1 > 0.5) & (in2 > 0.5),
    "or": lambda in1, in2: (in1 > 0.5) | (in2 > 0.5),
    "xor": lambda in1, in2: (in1 > 0.5) ^ (in2 > 0.5),
    "not": lambda in_: in_ <= 0.5,
    "switch": switch,
    "normalmap": normal_map,
    "transformmatrix": transform,
}
"""By the category of the node."""


def operation_inputs(category: str, given: tuple[str, ...]) -> tuple[str, ...]:
    """The names of the inputs that an operation takes, of those of its node, in its order; `combine` and `switch` take
    as many as there are."""
    names: list[str] = []
    for parameter in inspect.signature(OPERATIONS[category]).parameters.values():
        if parameter.kind is inspect.Parameter.VAR_KEYWORD:
            names += sorted((each for each in given if each[:2] == "in" and each[2:].isdecimal()), key=_number)
        else:
            names.append("in" if parameter.name == "in_" else parameter.name)
    return tuple(names)


def _number(name: str) -> int:
    return int(name[2:])


def apply_operation(category: str, names: tuple[str, ...], *values: Any) -> Array:
    """The result of an operation for inputs by name."""
    inputs = {"in_" if name == "in" else name: value for name, value in zip(names, values, strict=True)}
    return np.asarray(OPERATIONS[category](**inputs), np.float32)
