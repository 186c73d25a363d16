"""Finds the picture among the parts and channels of an OpenEXR file, and makes its channels RGB.

Names are those of the OpenEXR manual: R, G, B; Y alone; Y, RY, BY, luminance with subsampled chroma; X, Y, Z. A name
may begin with that of a layer ("diffuse.R"). Colours are premultiplied, so alpha is not needed for radiance.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import REC709, luminance_weights
from engine.core.errors import list_names

Float32Array = NDArray[np.float32]
Kind = Literal["rgb", "luminance_chroma", "xyz", "grey"]

_LONG_NAMES = {"red": "R", "green": "G", "blue": "B", "alpha": "A"}
# Of several layers the one with such a name is the picture; the others are what it is made of.
_WHOLE = ("combined", "beauty", "rgba", "rgb", "color", "colour", "main")


@dataclass(frozen=True)
class PartChannels:
    """A part of a file that can be shown: its number, its name, and the names of its channels in their order."""

    number: int
    name: str
    channels: Sequence[str]


@dataclass(frozen=True)
class ChosenChannels:
    """The picture of a file. kind: what its `names` are: R, G, B ("rgb", one of them may be missing: None); Y, RY, BY;
    X, Y, Z; or one channel ("grey")."""

    part: int
    kind: Kind
    names: tuple[str | None, ...]

    @property
    def read(self) -> tuple[str, ...]:
        """The channels that are read."""
        return tuple(name for name in self.names if name is not None)


def choose_channels(parts: Sequence[PartChannels], notes: list[str]) -> ChosenChannels | None:
    """The best picture in these parts, None if they have no channels; notes receives what is shown and what is not.

    Colours are better than parts of them, these better than one channel; then earlier parts, then channels without a
    layer's name, then layers that are named as the whole ("beauty"), then the order of the file.
    """
    found: list[tuple[tuple[int, int, int, int], ChosenChannels]] = []
    for at, part in enumerate(parts):
        for i, (layer, own) in enumerate(_by_layer(part.channels).items()):
            picture = _picture_of(own)
            if picture is not None:
                rank, kind, names = picture
                order = 0 if not layer else 1 if layer.rpartition(".")[2].casefold() in _WHOLE else 2
                found.append(((rank, at, order, i), ChosenChannels(part.number, kind, names)))
    if not found:
        return None
    chosen = min(found, key=lambda each: each[0])[1]
    notes += _describe(chosen, parts)
    return chosen


def _by_layer(channels: Iterable[str]) -> dict[str, dict[str, str]]:
    """For each layer the channels' full names, by their short ones."""
    layers: dict[str, dict[str, str]] = {}
    for name in channels:
        layer, _, last = name.rpartition(".")
        short = _LONG_NAMES.get(last.casefold(), last.upper())
        layers.setdefault(layer, {}).setdefault(short, name)
    return layers


def _picture_of(own: dict[str, str]) -> tuple[int, Kind, tuple[str | None, ...]] | None:
    """What the channels of one layer are as a picture, and its rank; 0 is best."""
    red, green, blue, y = (own.get(name) for name in "RGBY")
    if red and green and blue:
        return 0, "rgb", (red, green, blue)
    if y and "RY" in own and "BY" in own:
        return 0, "luminance_chroma", (y, own["RY"], own["BY"])
    if y and "X" in own and "Z" in own:
        return 1, "xyz", (own["X"], y, own["Z"])
    if y:
        return 2, "grey", (y,)
    if (red is not None) + (green is not None) + (blue is not None) == 2:
        return 3, "rgb", (red, green, blue)
    others = [name for short, name in own.items() if short != "A"] or list(own.values())
    return (4, "grey", (others[0],)) if others else None


def _describe(chosen: ChosenChannels, parts: Sequence[PartChannels]) -> list[str]:
    """Notes on what is shown, where that is not plain R, G, B, and on what is left out."""
    notes = []
    part = next(each for each in parts if each.number == chosen.part)
    if len(parts) > 1:
        others = [f"{each.name or each.number} ({list_names(each.channels)})" for each in parts if each is not part]
        notes.append(f"part {part.name or part.number} of {len(parts)} is shown, not {list_names(others)}")
    missing = [short for short, name in zip("RGB", chosen.names, strict=False) if name is None]
    if chosen.kind == "luminance_chroma":
        notes.append(f"luminance and chroma ({', '.join(chosen.read)}), converted to RGB")
    elif chosen.kind == "grey":
        notes.append(f"channel {chosen.read[0]} alone, shown as grey")
    elif missing or any("." in name for name in chosen.read):
        black = f", {missing[0]} black" if missing else ""
        notes.append(f"channels {', '.join(chosen.read)} are shown{black}")
    left = [name for name in part.channels if name not in chosen.read and not _is_alpha(name)]
    if left:
        notes.append(f"channels that are not shown: {list_names(left)}")
    return notes


def _is_alpha(name: str) -> bool:
    return name.rpartition(".")[2].upper() in ("A", "AR", "AG", "AB", "ALPHA")


def rgb_of_planes(
    chosen: ChosenChannels, planes: dict[str, Float32Array], chromaticities: Sequence[float] = REC709
) -> Float32Array:
    """RGB (H, W, 3), in the primaries of the file, of planes (H, W) by the names of `chosen`.

    Of luminance and chroma RY = (R - Y) / Y and BY = (B - Y) / Y, where Y is the weighted sum of R, G, B [Kainz13]. An
    infinite luminance is infinite in all three. Raises ValueError for invalid primaries.
    """
    if chosen.kind == "grey":
        return np.repeat(planes[chosen.read[0]][..., None], 3, axis=2)
    if chosen.kind != "luminance_chroma":
        black = np.zeros_like(planes[chosen.read[0]])
        return np.stack([black if name is None else planes[name] for name in chosen.names], axis=2)
    weights = luminance_weights(chromaticities).astype(np.float32)
    y, red_chroma, blue_chroma = (planes[name] for name in chosen.read)
    with np.errstate(invalid="ignore", over="ignore"):
        red, blue = (red_chroma + 1.0) * y, (blue_chroma + 1.0) * y
        green = (y - weights[0] * red - weights[2] * blue) / weights[1]
    rgb = np.stack([red, green, blue], axis=2)
    return np.where(np.isfinite(y)[..., None], rgb, y[..., None])


def interpolate_plane(
    plane: Float32Array, sampling: tuple[int, int], rows: NDArray[np.integer], width: int
) -> Float32Array:
    """A subsampled plane at full size, linear between its samples: (len(rows), width).

    sampling: every x-th column and y-th row has a sample, from the first on; rows: the rows that are wanted.
    """
    for axis, (step, wanted) in enumerate(zip(sampling[::-1], (rows, np.arange(width)), strict=True)):
        last = plane.shape[axis] - 1
        place = np.minimum(wanted / step, last)
        before = np.floor(place).astype(np.intp)
        after, share = np.minimum(before + 1, last), (place - before).astype(np.float32)
        low, high = np.take(plane, before, axis), np.take(plane, after, axis)
        weight = share[:, None] if axis == 0 else share
        with np.errstate(invalid="ignore"):
            # Where the share is 0 the next sample does not count, even if it is infinite.
            plane = np.where(weight > 0.0, low + weight * (high - low), low)
    return plane
