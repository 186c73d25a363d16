"""Slow, obvious twins of engine.curve: least squares over midpoints, the wavelet transform and strokes as loops."""

import math

import numpy as np


def hats(gamma, n_bands, domain=math.pi / 2):
    """Every hat at every angle, (N, J)."""
    position = np.clip(gamma * n_bands / domain - 0.5, 0.0, n_bands - 1.0)
    return np.maximum(1.0 - np.abs(position[:, None] - np.arange(n_bands)), 0.0)


def band_values(curve, n_bands, samples=400, domain=math.pi / 2, by_solid_angle=False):
    """The least-squares fit of the hats to the curve at midpoints, (J, 3); it may be negative."""
    gamma = (np.arange(n_bands * samples) + 0.5) * (domain / (n_bands * samples))
    root = np.sqrt(np.sin(gamma))[:, None] if by_solid_angle else 1.0
    return np.linalg.lstsq(hats(gamma, n_bands, domain) * root, curve(gamma) * root, rcond=None)[0]


def daubechies4(values):
    """Pyramid of the periodic Daubechies-4 filters of [BenArtzi07, tab. 4.1], one coefficient at a time."""
    d = [0.4829629131445341, 0.8365163037378077, 0.2241438680420134, -0.1294095225512603]
    low, high = d, [d[3], -d[2], d[1], -d[0]]
    result = list(values)
    length = len(result)
    while length > 1:
        smooth, detail = [], []
        for i in range(0, length, 2):
            taps = [result[(i + k) % length] for k in range(4)]
            smooth.append(sum(f * v for f, v in zip(low, taps, strict=True)))
            detail.append(sum(f * v for f, v in zip(high, taps, strict=True)))
        result[:length] = smooth + detail
        length //= 2
    return np.array(result)


def drawn_height(path, x):
    """The height at x of the last part of a pointer's path that passed there; a rise in place leaves its end."""
    height = None
    for (x0, y0), (x1, y1) in zip(path, path[1:], strict=False):
        if min(x0, x1) <= x <= max(x0, x1):
            height = y1 if x0 == x1 else y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    return height


def smoothed(y, deviation):
    """Gaussian-weighted means, sample by sample, of a stroke continued by point reflection at its ends."""
    n, found = len(y), []
    reach = min(math.ceil(4 * deviation), n - 1)
    for i in range(n):
        total = weights = 0.0
        for j in range(i - reach, i + reach + 1):
            value = 2 * y[0] - y[-j] if j < 0 else 2 * y[-1] - y[2 * (n - 1) - j] if j >= n else y[j]
            weight = math.exp(-((j - i) ** 2) / (2 * deviation**2))
            total, weights = total + weight * value, weights + weight
        found.append(total / weights)
    return np.array(found)
