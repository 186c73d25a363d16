"""Matching photographs in Python: the result of a match, and how a scene takes it over."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.interface.editing import Editing
from app.photo.photo_match import PhotoOutcome, match_photo
from app.photo.photo_request import PhotoRequest
from app.project.project import Project
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.inverse.camera_fit import PointPair

PairGiven = tuple[tuple[float, float], tuple[float, float, float]]


@dataclass(frozen=True, eq=False)
class MatchedPhoto:
    """What a match has found. error, before: relRMSE of the pixels that were held back, with the material that was
    found and as it was; exposure: from radiance to the photograph; n_pixels: how many were compared; camera_error: of
    the point pairs, pixels, None where there were none; deviations: of each curve, by "LAYER.CURVE", the standard
    deviation of its band values (J, 3): wide where the photograph does not determine it; notes: lines for the user."""

    error: float
    before: float
    exposure: float
    n_pixels: int
    camera_error: float | None
    deviations: dict[str, NDArray[np.float64]] = field(repr=False)
    notes: tuple[str, ...] = ()


def match_in_scene(
    editing: Editing,
    project: Project,
    name: str,
    file: str | os.PathLike[str],
    pairs: Sequence[PairGiven],
    **how: object,
) -> MatchedPhoto:
    """Match a photograph, and make what was found one edit; with pairs the camera and the photograph's shape are a
    second one. Raises InsituError."""
    pairs_given = tuple(_pair(each) for each in pairs)
    request = PhotoRequest(name, Path(file), pairs=pairs_given, **how)  # type: ignore[arg-type]
    outcome = run_to_end(match_photo(project, request))
    editing.do(outcome.edit)
    if outcome.camera is not None:
        editing.look_from(outcome.camera.camera, outcome.resolution)
    return matched_photo(outcome)


def matched_photo(outcome: PhotoOutcome) -> MatchedPhoto:
    match, camera = outcome.match, outcome.camera
    deviations = {f"{target.layer}.{target.name}": found for target, found in match.deviations.items()}
    return MatchedPhoto(
        match.error, match.before, match.exposure, match.n_pixels, None if camera is None else camera.error, deviations,
        outcome.notes,
    )  # fmt: skip


def _pair(given: PairGiven) -> PointPair:
    try:
        (column, row), (x, y, z) = given
        return PointPair((float(column), float(row)), (float(x), float(y), float(z)))
    except (TypeError, ValueError):
        raise InsituError(f"pair {given!r}, expected ((column, row), (x, y, z))") from None
