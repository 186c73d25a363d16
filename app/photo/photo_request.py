"""What a photograph is matched by: the object, the file, what aligns the camera, and what is to be found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from engine.core.errors import InsituError
from engine.inverse.camera_fit import PointPair
from engine.inverse.transfer_curve import SRGB, check_transfer
from engine.precompute.indirect.sampling_settings import MOST_BOUNCES

# The longer side of the picture that is compared.
LONGER_SIDE, LEAST_SIDE, MOST_SIDE = 1024, 16, 4096


@dataclass(frozen=True)
class PhotoRequest:
    """object: whose material is matched; file: of the photograph, in a transfer curve, see `engine.inverse.photo`;
    pairs: what aligns the camera, none where the scene's is right, with places in pixels, or `in_shares` of the
    photograph's width and height; mask: a picture of the same size that is black where
    the photograph does not count, None for none; targets: "LAYER.NAME" of what is to be found, none for
    `default_targets`; exposure: None to find it; finds_rotation, finds_lights: whether the rotation of the
    environment is to be found, and the strengths of the lights; n_bounces: None for as many as the scene requires;
    longer_side: of the picture that is compared, pixels; start: the material of the library to begin with, which is
    what remains where the photograph says nothing; "" for the object's own."""

    object: str
    file: Path
    transfer: str = SRGB
    pairs: tuple[PointPair, ...] = ()
    mask: Path | None = None
    targets: tuple[str, ...] = ()
    exposure: float | None = None
    finds_rotation: bool = False
    finds_lights: bool = False
    n_bounces: int | None = None
    longer_side: int = LONGER_SIDE
    start: str = ""
    in_shares: bool = False

    def __post_init__(self) -> None:
        check_transfer(self.transfer)
        if self.exposure is not None and not 1e-12 <= self.exposure <= 1e12:
            raise InsituError(f"exposure = {self.exposure:g}, expected 1e-12 to 1e12")
        if self.n_bounces is not None and not 1 <= self.n_bounces <= MOST_BOUNCES:
            raise InsituError(f"bounces = {self.n_bounces}, expected 1 to {MOST_BOUNCES}")
        if not LEAST_SIDE <= self.longer_side <= MOST_SIDE:
            raise InsituError(f"longer side = {self.longer_side}, expected {LEAST_SIDE} to {MOST_SIDE} pixels")
