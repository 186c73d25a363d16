"""Compiled: finds pixels at edges, and groups the rays through them that share a point."""

import numba as nb
import numpy as np

# Points further off each other's plane than the sine of 15° are not on one surface; above 1: any two points are.
SAME_PLANE, ANY_PLANE = np.float32(0.259), np.float32(2.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _alike(a, b, normal_a, normal_b, least, plane):
    """Whether two points may be merged: similar normals, and neither is off the other's plane."""
    cosine, length2, off_a, off_b = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for k in range(3):
        step = b[k] - a[k]
        cosine += normal_a[k] * normal_b[k]
        length2 += step * step
        off_a += step * normal_a[k]
        off_b += step * normal_b[k]
    far = plane * plane * length2
    return cosine >= least and off_a * off_a <= far and off_b * off_b <= far


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mark_edges(seen, ids, position, normal, least, edge):
    """Set edge (H, W) where a pixel and one of its neighbours see different objects, normals that turn, or a break."""
    height, width = seen.shape
    for y in range(height):
        for x in range(width):
            for step in range(4):
                v, u = y + (step > 0), x + (1, -1, 0, 1)[step]
                if v >= height or u < 0 or u >= width:
                    continue
                differs = seen[y, x] != seen[v, u]
                if not differs and ids[y, x] >= 0:
                    differs = not _alike(position[y, x], position[v, u], normal[y, x], normal[v, u], least, SAME_PLANE)
                if differs:
                    edge[y, x] = True
                    edge[v, u] = True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def group(ids, position, normal, places, least, plane, leader, share):
    """Group samples (F, n) that may share a point: leader (F, n) is the most central one of each group, −1 without a
    hit; share (F, n) is the part of the pixel's rays, the centre excluded, that each leader represents."""
    n = ids.shape[1]
    for f in range(ids.shape[0]):
        for k in range(n):
            leader[f, k] = k if ids[f, k] >= 0 else -1
            # Join the first earlier leader of the same object that is alike.
            for g in range(k):
                if ids[f, k] >= 0 and leader[f, g] == g and ids[f, g] == ids[f, k]:
                    if _alike(position[f, g], position[f, k], normal[f, g], normal[f, k], least, plane):
                        leader[f, k] = g
                        break
        _lead_from_the_middle(leader[f], places)
        share[f] = np.float32(0.0)
        # Shares count the n - 1 rays, not the centre.
        for k in range(1, n):
            if leader[f, k] >= 0:
                share[f, leader[f, k]] += np.float32(1.0 / (n - 1))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _lead_from_the_middle(leader, places):
    """Within each group that shares a point, make the ray nearest to the group's mean the leader; the centre's group
    keeps the centre."""
    n = leader.shape[0]
    for g in range(1, n):
        if leader[g] != g:
            continue
        x, y, count = np.float32(0.0), np.float32(0.0), 0
        for k in range(g, n):
            if leader[k] == g:
                x, y, count = x + places[k, 0], y + places[k, 1], count + 1
        best, closest = g, np.float32(np.inf)
        for k in range(g, n):
            if leader[k] == g:
                dx, dy = places[k, 0] - x / count, places[k, 1] - y / count
                if dx * dx + dy * dy < closest:
                    best, closest = k, dx * dx + dy * dy
        if best != g:
            for k in range(g, n):
                if leader[k] == g:
                    leader[k] = n + best  # not visited again
    for k in range(n):
        if leader[k] >= n:
            leader[k] -= n


@nb.njit(cache=True, nogil=True, error_model="numpy")
def find_nearest(rows, pixel, offset, objects, position, normal, row_image, least_alike, nearest):
    """Set nearest (X,) to the closest point at a pixel centre around each of rows (X,), on the same surface."""
    height, width = row_image.shape
    for i in range(rows.shape[0]):
        r = rows[i]
        y, x = pixel[r] // width, pixel[r] % width
        closest = np.float32(np.inf)
        for v in range(max(y - 1, 0), min(y + 2, height)):
            for u in range(max(x - 1, 0), min(x + 2, width)):
                s = row_image[v, u]
                dx, dy = np.float32(u - x) - offset[r, 0], np.float32(v - y) - offset[r, 1]
                far = dx * dx + dy * dy
                if s >= 0 and objects[s] == objects[r] and far < closest:
                    if _alike(position[r], position[s], normal[r], normal[s], least_alike[objects[r]], SAME_PLANE):
                        nearest[i], closest = s, far
