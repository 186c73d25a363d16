"""Measurements made up: tables of formulas, with noise and gaps, and the factors of none."""

import numpy as np

from engine.measured.measurement import CURVES, N_NODES, PARTS, Measurement, above_horizon, grid_directions, node_angles


def analytic_samples(noise: float = 0.0, gaps: float = 0.0) -> np.ndarray:
    """A coloured gloss over a matt ground (90, 90, 180, 3), 1/sr: 0.3 / π and less, and exp(-20 tan²θh) (0.1 + 0.9 θd⁵)
    times how the light slants; -1 below the horizon and at half of the samples of a share `gaps` of rows over φd."""
    random = np.random.default_rng(1)
    wi, wo = grid_directions()
    theta_h, theta_d = node_angles(True)[:-1, None, None, None], np.radians(np.arange(90.0))[:, None, None]
    gloss = np.exp(-20.0 * np.tan(theta_h) ** 2) * (0.1 + 0.9 * np.sin(theta_d) ** 5)
    slant = (1.0 + np.clip(wi[..., 2] * wo[..., 2], 0.0, 1.0))[..., None]
    samples = np.array([0.3, 0.2, 0.05]) / np.pi + gloss * slant * np.array([2.0, 2.5, 3.0])
    if noise:
        samples = samples * np.exp(random.normal(0.0, noise, samples.shape))
    torn = (random.random(samples.shape[:2]) < gaps)[..., None] & (random.random(samples.shape[:3]) < 0.5)
    missing = ~above_horizon() | torn
    return np.where(missing[..., None], -1.0, samples).astype(np.float32)


def drawn_measurement() -> Measurement:
    """A measurement whose table was never read: curves that fall and wave."""
    wave = 0.6 + 0.3 * np.sin(np.arange(N_NODES) * 1.7)
    curves = [(wave[:, None] * [1.0, 0.9, 0.8] / (1 + k)).astype(np.float32).tobytes() for k in range(len(CURVES))]
    strengths = tuple((0.1 + k, 0.2 + k, 0.3 + k) for k in range(len(PARTS)))
    return Measurement("drawn.binary", 5, strengths, tuple(curves))
