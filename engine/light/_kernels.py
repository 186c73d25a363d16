"""Compiled loops of the lights: light in geodesic triangles, RGBE scanlines, solid angles of patches.

Kernels never validate; the public functions beside them do. `float()` and `int()` around single elements preserve
double precision when the kernels run without the compiler, under NumPy's own promotion rules.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.sphere._kernels import solid_angle_from

Float64Array = NDArray[np.float64]
Image = NDArray[np.float32]
Int32Array = NDArray[np.int32]
Bytes = NDArray[np.uint8]


@njit(cache=True, nogil=True, error_model="numpy")
def integrate_above_edges(
    start: int,
    stop: int,
    edges: Int32Array,
    vertices: Float64Array,
    turn: float,
    radiance: Image,
    light_above: Float64Array,
    row_edges: Float64Array,
    integrals: Float64Array,
) -> None:
    """Writes integrals (E, 3)[start:stop]: the light between each edge and the zenith, from its first to its second
    vertex.

    Positive where azimuth increases along the edge. row_edges (H + 1, 2): cosine and cotangent of theta at the rows'
    edges. See `engine.light.environment` for the formulas.
    """
    for e in range(start, stop):
        integrals[e, 0] = integrals[e, 1] = integrals[e, 2] = 0.0
        # The normal of the great circle through both vertices.
        a, b = vertices[edges[e, 0]], vertices[edges[e, 1]]
        nx, ny, nz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / length, ny / length, nz / length
        if abs(ny) < 1e-12:
            continue  # a meridian, or an edge that ends on the y axis: azimuth does not change along it
        # The shorter way round in azimuth, walked in the direction of increasing azimuth.
        phi_a, phi_b = math.atan2(a[0], -a[2]), math.atan2(b[0], -b[2])
        step = phi_b - phi_a
        if step > math.pi:
            step -= 2.0 * math.pi
        elif step < -math.pi:
            step += 2.0 * math.pi
        first = phi_a if step > 0.0 else phi_a + step
        # Azimuth of the circle's highest point, its height k there, and sqrt(1 - k^2).
        circle = (math.atan2(-nx * ny, nz * ny) + turn, math.sqrt(nx * nx + nz * nz), abs(ny))
        _walk_arc(first + turn, abs(step), circle, radiance, light_above, row_edges, integrals[e])
        if step < 0.0:
            for channel in range(3):
                integrals[e, channel] = -integrals[e, channel]


@njit(cache=True, nogil=True, error_model="numpy")
def _walk_arc(
    first: float,
    step: float,
    circle: tuple[float, float, float],
    radiance: Image,
    light_above: Float64Array,
    row_edges: Float64Array,
    result: Float64Array,
) -> None:
    """Adds the light above the great-circle arc of azimuths first .. first + step, texel by texel.

    circle: azimuth of its highest point, the height k there, and sqrt(1 - k^2) without cancellation. Each section ends
    at a column's edge, or where the height has an extremum, so that height is monotone within it.
    """
    peak, k, ny = circle
    height, width = radiance.shape[0], radiance.shape[1]
    to_column = width / (2.0 * math.pi)
    psi, last = first - peak, first + step - peak
    column = math.floor((first + math.pi) * to_column)
    half_turn = math.floor(psi / math.pi)
    row, area = _row_and_area(psi, k, ny, height)
    while psi < last:
        # The next end of a section: a column's edge, an extremum of the height, or the end of the arc.
        column_edge = (column + 1) / to_column - math.pi - peak
        turning = (half_turn + 1) * math.pi
        end = max(psi, min(column_edge, turning, last))
        end_row, end_area = _row_and_area(end, k, ny, height)
        side = 1 if end_row > row else -1
        # Within the section, walk from row to row: the circle crosses a row's edge at cos psi = (ny / k) cot theta.
        while True:
            until, until_area = end, end_area
            if row != end_row:
                cosine = row_edges[row + (1 if side > 0 else 0), 1] * ny / k
                inside = math.acos(min(1.0, max(-1.0, cosine)))
                crossing = turning - inside if half_turn % 2 != 0 else turning - math.pi + inside
                until = min(end, crossing) if crossing > psi else psi
                until_area = _area_from_peak(math.sin(until), math.cos(until), k, ny)
            # Integral of A(phi, h) over this piece: A is linear in h within a texel.
            cell = column % width
            for channel in range(3):
                light = float(radiance[row, cell, channel])
                above = light_above[row, cell, channel] + light * row_edges[row, 0]
                result[channel] += above * (until - psi) - light * (until_area - area)
            psi, area = until, until_area
            if row == end_row:
                break
            row += side
        if end >= column_edge:
            column += 1
        if end >= turning:
            half_turn += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _row_and_area(psi: float, k: float, ny: float, height: int) -> tuple[int, float]:
    """The texel row of the circle at azimuth psi from its highest point, tan(latitude) = (k / ny) cos psi; and the
    area."""
    sine, cosine = math.sin(psi), math.cos(psi)
    theta = 0.5 * math.pi - math.atan2(k * cosine, ny)
    row = min(max(int(theta / math.pi * height), 0), height - 1)
    return row, _area_from_peak(sine, cosine, k, ny)


@njit(cache=True, nogil=True, error_model="numpy")
def _area_from_peak(sine: float, cosine: float, k: float, ny: float) -> float:
    """The integral of the height from the highest point to psi, asin(k sin psi), without cancellation near the y
    axis."""
    return math.atan2(k * sine, math.sqrt(cosine * cosine + ny * ny * sine * sine))


@njit(cache=True, nogil=True, error_model="numpy")
def sum_around_triangles(
    start: int,
    stop: int,
    triangles: Int32Array,
    triangle_edges: Int32Array,
    edge_integrals: Float64Array,
    integrals: Float64Array,
) -> None:
    """integrals (T, 3)[start:stop]: the signed sum over the three edges of each triangle."""
    for t in range(start, stop):
        for channel in range(3):
            total = 0.0
            for corner in range(3):
                value = edge_integrals[triangle_edges[t, corner], channel]
                forward = triangles[t, corner] < triangles[t, (corner + 1) % 3]
                total += value if forward else -value
            integrals[t, channel] = total


@njit(cache=True, nogil=True, error_model="numpy")
def decode_rgbe(data: Bytes, position: int, first: int, pixels: Bytes) -> tuple[int, int, int]:
    """Decodes Radiance scanlines from data[position:] into rows from `first` on of pixels (H, W, 4) uint8 [Ward91].

    New run-length scanlines start with 2, 2 and the width; all others are flat quadruples, where 1, 1, 1, n repeats the
    previous pixel. Returns (status, row, byte): 0 success; 1 the data end early; 2 a run exceeds its scanline; 3 a
    scanline states another width; 4 a repeat without a previous pixel.
    """
    height, width = pixels.shape[0], pixels.shape[1]
    end = len(data)
    for row in range(first, height):
        if position + 4 > end:
            return 1, row, position
        packed = data[position] == 2 and data[position + 1] == 2 and data[position + 2] < 128 and 8 <= width <= 32767
        # New run-length encoding: each channel on its own, in runs (count > 128) and literals.
        if packed:
            if 256 * int(data[position + 2]) + int(data[position + 3]) != width:
                return 3, row, position
            position += 4
            for channel in range(4):
                column = 0
                while column < width:
                    if position + 2 > end:
                        return 1, row, position
                    count = int(data[position])
                    if count > 128:
                        count -= 128
                        if column + count > width:
                            return 2, row, position
                        pixels[row, column : column + count, channel] = data[position + 1]
                        position += 2
                    else:
                        if count == 0 or column + count > width:
                            return 2, row, position
                        if position + 1 + count > end:
                            return 1, row, position
                        for i in range(count):  # not all at once: for that the compiler generates error messages
                            pixels[row, column + i, channel] = data[position + 1 + i]
                        position += 1 + count
                    column += count
            continue
        # Flat pixels and old run-length encoding; consecutive repeats shift the count by 8 bits each.
        column = 0
        shift = 0
        while column < width:
            if position + 4 > end:
                return 1, row, position
            quad = data[position : position + 4]
            if quad[0] == 1 and quad[1] == 1 and quad[2] == 1:
                count = int(quad[3]) << shift
                if column == 0 and row == 0:
                    return 4, row, position
                if column + count > width or shift > 24:
                    return 2, row, position
                before = pixels[row, column - 1] if column > 0 else pixels[row - 1, width - 1]
                for i in range(count):
                    for channel in range(4):
                        pixels[row, column + i, channel] = before[channel]
                column += count
                shift += 8
            else:
                for channel in range(4):
                    pixels[row, column, channel] = quad[channel]
                column += 1
                shift = 0
            position += 4
    return 0, height, position


@njit(cache=True, nogil=True, error_model="numpy")
def solid_angles_range(points: Float64Array, corners: Float64Array, start: int, stop: int, result: Image) -> None:
    """result[p, m] for points [start, stop): signed solid angle of patch m."""
    for p in range(start, stop):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        for m in range(len(corners)):
            result[p, m] = solid_angle_from(x, y, z, corners[m])
