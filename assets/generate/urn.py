"""Urn: a glazed jar with a brass collar and a brass lid, a model of several materials in one file."""

from pathlib import Path

import numpy as np

from .glb import Part, save_parts_glb
from .mesh import Mesh
from .surfaces import Profile, bezier, carried, circle, rounded_profile

# Curves of the body (radius, height), from the foot up to the neck, which the collar hides.
_BODY = [
    [(0.110, 0.000), (0.122, 0.006), (0.112, 0.030), (0.106, 0.048)],
    [(0.106, 0.048), (0.096, 0.084), (0.268, 0.180), (0.268, 0.400)],
    [(0.268, 0.400), (0.268, 0.560), (0.120, 0.590), (0.104, 0.660)],
]
_COLLAR = [(0.100, 0.640, 0), (0.122, 0.640, 0.009), (0.122, 0.676, 0.009), (0.100, 0.676, 0)]
_LID = [
    (0.112, 0.676, 0), (0.138, 0.676, 0.006), (0.138, 0.694, 0.008), (0.118, 0.712, 0.006), (0.052, 0.748, 0.03),
    (0.020, 0.766, 0.012), (0.018, 0.790, 0.008), (0.038, 0.806, 0.010), (0.036, 0.838, 0.012), (0.0, 0.850, 0),
]  # fmt: skip


def save(path: Path) -> None:
    parts = {"collar": rounded_profile(_COLLAR, 5), "lid": rounded_profile(_LID, 5)}
    brass = [Part(carried(profile, circle(64)), name, (0.83, 0.62, 0.30), 1.0, 0.22) for name, profile in parts.items()]
    save_parts_glb(path, [Part(body(), "glaze", (0.015, 0.105, 0.125), 0.0, 0.16), *brass])


def body() -> Mesh:
    """The jar's outside, closed by a flat foot and below the lid."""
    t = np.linspace(0.0, 1.0, 14)
    points = np.concatenate([bezier(np.array(curve), t[1 if i else 0 :]) for i, curve in enumerate(_BODY)])
    way = np.gradient(points, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return carried(Profile(points, np.stack([way[:, 1], -way[:, 0]], axis=1)), circle(64))
