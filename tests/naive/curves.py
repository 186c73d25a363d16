"""Slow, obvious twins of engine.curve: midpoint sums, and the wavelet transform written as loops."""

import math

import numpy as np


def band_means(curve, n_bands, samples=20000, domain=math.pi / 2):
    """Mean over each band by the midpoint rule, (J, 3)."""
    gamma = (np.arange(n_bands * samples) + 0.5) * (domain / (n_bands * samples))
    return curve(gamma).reshape(n_bands, samples, 3).mean(axis=1)


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
