"""Writes RGL's tensor files as an acquisition of a formula would give them: slow and obvious, by bisection.

The formula is GGX, isotropic or with two widths, over a Lambertian ground; its normal distribution, projected area and
visible normals are in closed form [Heitz14].
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

TYPES = {"uint8": 1, "float32": 10}


def tensor_bytes(fields: Mapping[str, np.ndarray]) -> bytes:
    """A tensor file of these fields."""
    head = b"tensor_file\0\1\0" + struct.pack("<I", len(fields))
    offset = len(head) + sum(13 + len(name) + 8 * field.ndim for name, field in fields.items())
    body = b""
    for name, field in fields.items():
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack("<HBQ", field.ndim, TYPES[field.dtype.name], offset + len(body))
        head += struct.pack(f"<{field.ndim}Q", *field.shape)
        body += field.tobytes()
    return head + body


@dataclass(frozen=True)
class Gloss:
    """GGX with widths along x and y over a Lambertian ground."""

    along: float = 0.4
    across: float = 0.4
    ground: tuple[float, ...] = (0.3, 0.2, 0.05)
    shine: tuple[float, ...] = (0.9, 0.8, 0.6)

    def facets(self, m: np.ndarray) -> np.ndarray:
        """D(m) of directions (..., 3)."""
        x, y, z = m[..., 0] / self.along, m[..., 1] / self.across, m[..., 2]
        return 1.0 / (np.pi * self.along * self.across * (x * x + y * y + z * z) ** 2)

    def area(self, w: np.ndarray) -> np.ndarray:
        """The projected area of microfacets seen from w: (cos + sqrt(cos^2 + a_x^2 x^2 + a_y^2 y^2)) / 2."""
        x, y, z = w[..., 0] * self.along, w[..., 1] * self.across, w[..., 2]
        return 0.5 * (z + np.sqrt(z * z + x * x + y * y))

    def reflection(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """rho (..., C), 1/sr, above the horizon: D G1 G1 / (4 cos cos) with G1 = cos / area, and the ground."""
        half = wi + wo
        m = half / np.linalg.norm(half, axis=-1, keepdims=True)
        gloss = self.facets(m) / (4.0 * self.area(wi) * self.area(wo))
        return gloss[..., None] * np.array(self.shine) + np.array(self.ground) / np.pi


def acquired(
    gloss: Gloss,
    n_theta: int = 8,
    n_phi: int = 1,
    n: int = 32,
    n_facets: int = 64,
    turn: float = 2.0 * np.pi,
    wavelengths: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """The fields of an acquisition of a gloss: n_theta angles and n_phi azimuths of wi, from -pi through `turn`, n x n
    samples of each; distributions of n_facets x n_facets."""
    theta = np.linspace(0.0, np.radians(85.0), n_theta)
    phi = -np.pi + np.linspace(0.0, turn, n_phi) if n_phi > 1 else np.zeros(1)
    side, fine = np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, n_facets)
    v, u = np.meshgrid(fine, fine, indexing="ij")
    vndf, colours = [], []
    for azimuth in phi:
        for angle in theta:
            wi = _direction(angle, azimuth)
            about = azimuth if n_phi == 1 else 0.0
            m = _direction(np.pi / 2 * u**2, (2.0 * v - 1.0) * np.pi + about)
            # Visible normals per u and v: sin(theta) d theta d phi = sin(theta) pi u du 2 pi dv.
            seen = gloss.facets(m) * np.maximum(m @ wi, 0.0) / gloss.area(wi)
            density = seen * 2.0 * np.pi**2 * u * np.sin(np.pi / 2 * u**2)
            vndf.append(density)
            y, x = np.meshgrid(side, side, indexing="ij")
            at_u, at_v = _from_square(density, x.ravel(), y.ravel())
            m = _direction(np.pi / 2 * at_u**2, (2.0 * at_v - 1.0) * np.pi + about)
            wo = 2.0 * (m @ wi)[:, None] * m - wi
            up = wo[:, 2] > 0.0
            wo[:, 2] = np.maximum(wo[:, 2], 0.0)
            rho = gloss.reflection(np.broadcast_to(wi, wo.shape), wo)
            divided = rho * (wo[:, 2] * 4.0 * gloss.area(wi) / gloss.facets(m))[:, None]
            colours.append(np.where(up[:, None], divided, 0.0).T.reshape(-1, n, n))
    wi = _direction(np.pi / 2 * u**2, (2.0 * v - 1.0) * np.pi)
    n_phi = len(phi)
    fields = {
        "description": np.frombuffer(b"GGX", np.uint8),
        "phi_i": phi,
        "theta_i": theta,
        "ndf": gloss.facets(wi),
        "sigma": gloss.area(wi),
        "vndf": np.reshape(vndf, (n_phi, n_theta, n_facets, n_facets)),
        "luminance": np.ones((n_phi, n_theta, n, n)),
        "jacobian": np.ones(1, np.uint8),
        "rgb" if wavelengths is None else "spectra": np.reshape(colours, (n_phi, n_theta, -1, n, n)),
    }
    if wavelengths is not None:
        fields["wavelengths"] = wavelengths
    return {name: each if each.dtype == np.uint8 else each.astype(np.float32) for name, each in fields.items()}


def _direction(theta: np.ndarray | float, phi: np.ndarray | float) -> np.ndarray:
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def _from_square(density: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u, v whose integrals over a bilinear density are x, y: v by bisection of the integral over rows, then u by that
    along the row."""
    rows = _integral(density)[:, -1]
    v = _bisected(_antiderivative(rows[None]), y)
    place = np.minimum((v * (len(rows) - 1)).astype(int), len(rows) - 2)
    s = (v * (len(rows) - 1) - place)[:, None]
    row = (1.0 - s) * density[place] + s * density[place + 1]
    return _bisected(_antiderivative(row), x), v


def _integral(values: np.ndarray) -> np.ndarray:
    """Of a piecewise linear function, from its first node to each."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1])
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


def _antiderivative(values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The share of the integral of piecewise linear functions (N or 1, n) from 0 to places (N,) in [0, 1]."""
    integral, n = _integral(values), values.shape[-1]

    def share(at: np.ndarray) -> np.ndarray:
        k = np.minimum((at * (n - 1)).astype(int), n - 2)
        t, which = at * (n - 1) - k, np.arange(len(at)) % len(values)
        left, right = values[which, k], values[which, k + 1]
        return (integral[which, k] + t * (left + 0.5 * t * (right - left))) / integral[which, -1]

    return share


def _bisected(integral: Callable[[np.ndarray], np.ndarray], target: np.ndarray) -> np.ndarray:
    low, high = np.zeros_like(target), np.ones_like(target)
    for _ in range(40):
        middle = 0.5 * (low + high)
        under = integral(middle) < target
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    return 0.5 * (low + high)
