"""A parameter that varies over a surface: one channel of an image gives its value at each point,

    value(u, v) = low + (high − low) c(u, v),    or, for images of a root,    (√low + (√high − √low) c(u, v))²,

where c in [0, 1] is the channel, linear; glTF's roughness is such a root, of the width α. Values below the least that
the parameter accepts are that. `engine.material.parameter_nodes` makes a few
layers of a layer with such maps. Where an image cannot be read, the parameter's own value counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import ChannelImage
from engine.material.map_tables import IMAGE_KEYS, channel_image_from, channel_image_table
from engine.material.parameters import Parameter, ParameterError, Value

Float64Array = NDArray[np.float64]
Response = Literal["linear", "square"]
RESPONSES: tuple[Response, ...] = get_args(Response)
MAPPED_KINDS = ("scalar", "rgb")
N_BINS = 256
# The share of texels at either end of a channel's range that nodes need not reach: a few black texels of a border would
# spread the nodes over values that nothing else has.
_TAIL = 1e-3


@dataclass(frozen=True)
class ParameterMap:
    """The map of one parameter. low, high: its values at 0 and 1 of the channel; response: "square" where the value's
    root follows the channel; least: of the values, where the ends are below it."""

    parameter: str
    image: ChannelImage
    low: Value
    high: Value
    response: Response = "linear"
    least: float = 0.0

    def values(self, channel: Float64Array) -> Float64Array:
        """The values (N, 1 or 3) for channel values (N,)."""
        low, high = np.atleast_1d(np.array(self.low, float)), np.atleast_1d(np.array(self.high, float))
        share = np.clip(channel, 0.0, 1.0)[:, None]
        rest = 1.0 - share
        if self.response == "square":  # multiplied out, so that both ends are exact
            return np.maximum(low * rest**2 + 2.0 * np.sqrt(low * high) * rest * share + high * share**2, self.least)
        return np.maximum(low * rest + high * share, self.least)

    def value_at(self, channel: float) -> Value:
        """The value for one channel value."""
        numbers = self.values(np.array([channel]))[0].tolist()
        return numbers[0] if len(numbers) == 1 else cast(Value, tuple(numbers))

    def with_file(self, file: str) -> ParameterMap:
        """The same map of another file."""
        return replace(self, image=replace(self.image, file=file))


ParameterMaps = tuple[ParameterMap, ...]


@dataclass(frozen=True)
class ChannelStatistics:
    """Statistics of an image's channel: its least and its greatest value, without the thousandth of texels at either
    end, and the share of texels in each of 256 equal parts of [0, 1]."""

    low: float
    high: float
    shares: tuple[float, ...]

    def cumulated(self, channel: Float64Array) -> Float64Array:
        """The share of texels below channel values (N,), (N,)."""
        edges = np.linspace(0.0, 1.0, N_BINS + 1)
        return np.interp(channel, edges, np.concatenate([[0.0], np.cumsum(self.shares)]))


def channel_statistics(channel: NDArray[np.floating]) -> ChannelStatistics:
    """The statistics of a channel's texels (...)."""
    texels = np.clip(np.asarray(channel, np.float64).ravel(), 0.0, 1.0)
    low, high = np.quantile(texels, [_TAIL, 1.0 - _TAIL], method="nearest").tolist()
    counts, _ = np.histogram(texels, N_BINS, (0.0, 1.0))
    return ChannelStatistics(low, high, tuple((counts / texels.size).tolist()))


def parameter_map_from(parameter: Parameter, table: object) -> ParameterMap:
    """The map of a parameter from its form in files: `{map, channel, range, response, least, repeats, offset, rotation,
    wrap, uv_set}`, of which only `map`, the image's file, is required; or that file alone. The range is the parameter's
    own where none is given; its ends may be 0, and the values are at least `least`. Raises ParameterError."""
    name = f"{parameter.name} map"
    if isinstance(table, str):
        table = {"map": table}
    if parameter.kind not in MAPPED_KINDS:
        raise ParameterError(name, table, f"a parameter that is a number or a colour; {parameter.name} is neither")
    if not isinstance(table, Mapping) or not table.get("map") or not set(table) <= set(_KEYS):
        raise ParameterError(name, table, f"a table of map and, where they differ, {', '.join(_KEYS[1:])}")
    image = channel_image_from(name, table)
    response = table.get("response", "linear")
    if response not in RESPONSES:
        raise ParameterError(f"{name}: response", response, " or ".join(f'"{each}"' for each in RESPONSES))
    ends = table.get("range", parameter.limits)
    if not isinstance(ends, (list, tuple)) or len(ends) != 2:
        raise ParameterError(f"{name}: range", ends, f"two values, at black and at white, each {parameter.expected}")
    end_value = replace(parameter, minimum=min(parameter.minimum, 0.0))
    low, high = (end_value.accept(list(end) if isinstance(end, tuple) else end) for end in ends)
    if response == "square" and end_value.minimum < 0.0:
        raise ParameterError(f"{name}: response", response, '"linear": the parameter may be below 0')
    least = cast(float, replace(parameter, kind="scalar").accept(table.get("least", parameter.minimum)))
    return ParameterMap(parameter.name, image, low, high, cast(Response, response), least)


def parameter_map_table(map_: ParameterMap) -> dict[str, Any]:
    """The inverse; keys at their defaults are omitted, except for those whose defaults are the parameter's."""
    found = channel_image_table(map_.image) | {"range": (map_.low, map_.high), "least": map_.least}
    return found | ({"response": map_.response} if map_.response != "linear" else {})


def parameter_maps_from(parameters: tuple[Parameter, ...], tables: Mapping[str, object]) -> ParameterMaps:
    """The maps of a layer with these parameters, from their tables by the parameter's name. Raises ParameterError."""
    known = {parameter.name: parameter for parameter in parameters if parameter.kind in MAPPED_KINDS}
    for name in tables:
        if name not in known:
            raise ParameterError("parameter_maps", name, "one of " + ", ".join(known))
    return tuple(parameter_map_from(known[name], tables[name]) for name in sorted(tables))


def maps_that_fit(maps: ParameterMaps, parameters: tuple[Parameter, ...]) -> ParameterMaps:
    """The maps that a layer of another model, with these parameters, can keep."""
    found = []
    for each in maps:
        parameter = next((known for known in parameters if known.name == each.parameter), None)
        if parameter is not None:
            with suppress(ParameterError):
                found.append(parameter_map_from(parameter, parameter_map_table(each)))
    return tuple(found)


def with_map_files(maps: ParameterMaps, renamed: Callable[[str], str]) -> ParameterMaps:
    """The maps with other names of their images."""
    return tuple(each.with_file(renamed(each.image.file)) for each in maps)


_KEYS = (*IMAGE_KEYS, "range", "response", "least")
