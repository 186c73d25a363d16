"""Bat: a creature whose thin wings let light through, on five joints that an animation has flap; after [Sloan05,
fig. 1]."""

from pathlib import Path

import numpy as np

from .glb import Joint, Motion, Skinned, save_glb
from .mesh import Floats, Mesh, merged, moved
from .surfaces import arc_profile, carried, circle, parametric, tube

ROOT, ELBOW, TIP = 0.05, 0.24, 0.62  # metres from the middle, along a wing
PERIOD, N_KEYS = 1.2, 25  # seconds; the last key is the first again
JOINTS = (
    Joint("body", (0.0, 0.30, 0.0)),
    Joint("left arm", (ROOT, 0.32, 0.0), 0),
    Joint("left hand", (ELBOW, 0.32, 0.0), 1),
    Joint("right arm", (-ROOT, 0.32, 0.0), 0),
    Joint("right hand", (-ELBOW, 0.32, 0.0), 3),
)


def save(path: Path) -> None:
    """The whole of it, as a GLB file."""
    save_glb(path, creature(), JOINTS, "flap", flapping())


def creature() -> list[Skinned]:
    """Its fur, then its wings."""
    fur, wings = _fur(), merged([_wing(1.0), _wing(-1.0)])
    of_fur = np.zeros((len(fur.positions), len(JOINTS)))
    of_fur[:, 0] = 1.0
    skin = Skinned(wings, _weights(wings), (0.50, 0.22, 0.15), "wings")
    return [Skinned(fur, of_fur, (0.10, 0.06, 0.045), "fur"), skin]


def flapping() -> list[Motion]:
    """The hands come after the arms, and the body sinks while the wings rise."""
    times = np.linspace(0.0, PERIOD, N_KEYS)
    phase = 2.0 * np.pi * times / PERIOD
    arm, hand = np.radians(30.0) * np.sin(phase) + np.radians(6.0), np.radians(26.0) * np.sin(phase - 0.9)
    motions = [Motion(0, times, np.stack([0.0 * phase, -0.025 * np.sin(phase), 0.0 * phase], axis=1))]
    for joint, angle in ((1, arm), (2, hand), (3, -arm), (4, -hand)):
        none = np.zeros_like(angle)
        motions.append(Motion(joint, times, np.stack([none, none, np.sin(angle / 2), np.cos(angle / 2)], axis=1)))
    return motions


def _wing(side: float) -> Mesh:
    """A sheet over s along the wing and t from its front edge to its scalloped rear, between ribs."""

    def surface(s: Floats, t: Floats) -> Floats:
        front = 0.07 + 0.10 * np.sin(np.pi * np.clip(s, 0, 1) ** 0.8) - 0.16 * s**3
        scallop = 0.045 * np.abs(np.sin(4.0 * np.pi * s)) ** 0.8
        rear = -0.20 + 0.21 * s**2 + scallop * (1.0 - 0.6 * s)
        ribs = 0.006 * np.cos(8.0 * np.pi * s) * t
        height = 0.32 + 0.035 * np.sin(np.pi * s) * (1.0 - (t - 0.35) ** 2) + ribs
        return np.stack([side * (0.035 + (TIP - 0.035) * s), height, front + (rear - front) * t], axis=-1)

    u, v = np.linspace(0.0, 1.0, 97), np.linspace(0.0, 1.0, 33)
    return parametric(surface, u, v) if side < 0 else parametric(lambda t, s: surface(s, t), v, u)


def _weights(wings: Mesh) -> Floats:
    """From body to arm about the root, from arm to hand about the elbow, each over some centimetres."""
    along = np.abs(wings.positions[:, 0])
    arm, hand = (_smooth((along - place) / width + 0.5) for place, width in ((ROOT, 0.05), (ELBOW, 0.12)))
    left = wings.positions[:, 0] > 0.0
    weights = np.zeros((len(along), len(JOINTS)))
    weights[:, 0] = 1.0 - arm
    for first, where in ((1, left), (3, ~left)):
        weights[:, first] = np.where(where, arm * (1.0 - hand), 0.0)
        weights[:, first + 1] = np.where(where, arm * hand, 0.0)
    return weights


def _fur() -> Mesh:
    """A body along Z, its head to the front, with two ears."""
    z = np.linspace(-0.15, 0.13, 28)
    radius = 0.058 * np.sqrt(np.maximum(1.0 - (z / 0.19) ** 2, 0.05)) * (1.0 - 0.9 * z)
    path = np.stack([0.0 * z, 0.30 + 0.10 * z, z], axis=1)
    head = moved(carried(arc_profile(0.052, (0, 0), -np.pi / 2, np.pi / 2, 25), circle(36)), (0.0, 0.335, 0.155))
    ears = [_ear(side) for side in (1.0, -1.0)]
    return merged([tube(path, radius, 36), head, *ears])


def _ear(side: float) -> Mesh:
    t = np.linspace(0.0, 1.0, 12)
    path = np.stack([side * (0.022 + 0.022 * t), 0.365 + 0.07 * t, 0.15 - 0.01 * t], axis=1)
    return tube(path, 0.020 * (1.0 - 0.85 * t), 20)


def _smooth(value: Floats) -> Floats:
    t = np.clip(value, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
