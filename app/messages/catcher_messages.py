"""The request for what shadow catchers show where nothing stands on them, and its responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import Request, Response, SetCamera

if TYPE_CHECKING:
    from app.document.document import Document
    from engine.settings import RenderSettings


@dataclass(frozen=True, eq=False)
class FindCatcherLight(Request):
    """Draw shadow catchers and what emits alone, as the traced view sees them, for Placement. document: that of
    `catchers_alone`. Answered by `CatcherProgress` and at last by `CatcherLightFound`."""

    built_on = (SetCamera,)
    answered_once = True

    document: Document
    settings: RenderSettings


@dataclass(frozen=True)
class CatcherProgress(Response):
    """The work has come so far, from 0 to 1."""

    is_partial = True

    fraction: float


@dataclass(frozen=True, eq=False)
class CatcherLightFound(Response):
    """W (H, W, 3), see `app.stills.shadow_catcher`, in each pixel as if catchers filled it; of shape (0, 0, 3) where
    there is no pixel that they fill."""

    light: NDArray[np.float32]
