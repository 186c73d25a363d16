"""Small frames and transports for the tests of the renderer."""

import numpy as np

from engine.scene.picture_frame import PictureFrame
from engine.settings import Precision
from ui.modes.placement.gl.renderer import PlacementRenderer


def frame_of(object_image: np.ndarray, emitters: tuple[int, ...] = (), seed: int = 5) -> PictureFrame:
    """A frame in which every object that is no emitter reflects; view angles and ray directions are random."""
    rng = np.random.default_rng(seed)
    height, width = object_image.shape
    n_objects = int(object_image.max()) + 1
    flat = object_image.ravel()
    pixels = [np.flatnonzero(flat == i) if i not in emitters else np.zeros(0, int) for i in range(n_objects)]
    ends = np.cumsum([0] + [len(p) for p in pixels])
    ranges = np.stack([ends[:-1], ends[1:]], axis=1)
    emission = np.zeros((height, width, 3), dtype=np.float32)
    for i_object in emitters:
        emission[object_image == i_object] = (4.0, 3.0, 2.0)
    rays = rng.normal(size=(height, width, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return PictureFrame(
        pixel=np.concatenate([np.zeros(0, int), *pixels]).astype(np.int32),
        object_ranges=ranges.astype(np.int32),
        object_image=object_image.astype(np.int16),
        theta_o=rng.uniform(0, np.pi / 2, int(ends[-1])).astype(np.float32),
        emission_image=emission,
        ray_directions=rays.astype(np.float32),
    )


def full_frame(n_pixels: int) -> PictureFrame:
    """One row of pixels, all of object 0."""
    return frame_of(np.zeros((1, n_pixels), dtype=int))


def norms_of(transport: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(transport.astype(np.float64) ** 2, axis=1))


def halves_of(transport: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half floats (J,p,3) and the scale (J,) of each plane, a power of two: true values are the product."""
    largest = np.abs(transport).max(axis=(1, 2))
    scale = np.exp2(np.ceil(np.log2(np.where(largest > 0.0, largest, 1.0))))
    return (transport / scale[:, None, None]).astype(np.float16), scale


def start_layer(
    renderer: PlacementRenderer, transport: np.ndarray, coefficients: np.ndarray, precision: Precision = "float"
) -> None:
    """One object whose only layer, "ball.0", shows `transport` (J,p,3) under `coefficients` (J,3)."""
    renderer.set_frame(full_frame(transport.shape[1]))
    renderer.set_layer("ball.0", 0, transport.shape[1])
    numbers, scale = halves_of(transport) if precision == "half" else (transport, np.ones(len(transport)))
    renderer.begin_transport("ball.0", numbers, norms_of(transport), scale)
    while not renderer.upload(1.0):
        pass
    renderer.want("ball.0", coefficients)
    finish(renderer)


def finish(renderer: PlacementRenderer) -> None:
    """Update until the picture is exact."""
    for _ in range(100):
        if renderer.update().exact:
            return
    raise AssertionError("the picture never became exact")


def contracted(transport: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Σ_k c_k T_k in float64: what the layer must show, (p,3)."""
    return np.einsum("kc,kpc->pc", np.asarray(coefficients, np.float64), transport.astype(np.float64))


def relative_error(image: np.ndarray, reference: np.ndarray) -> float:
    """Root mean square difference over the root mean square of the reference."""
    difference = image.astype(np.float64) - reference
    return float(np.sqrt(np.mean(difference**2)) / max(np.sqrt(np.mean(reference**2)), 1e-300))
