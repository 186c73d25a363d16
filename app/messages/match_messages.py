"""The request to match a material with a model, and its responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.messages.worker_messages import Request, Response, SetCamera

if TYPE_CHECKING:
    from app.document.document import Document
    from app.document.material_match import MaterialMatch
    from engine.material.layer import Layer


@dataclass(frozen=True, eq=False)
class MatchMaterial(Request):
    """Match a material with a model, and draw both in place, in the traced view. document: the one that pictures are
    made of; n_bounces: of those pictures. Answered by `MaterialMatched`."""

    built_on = (SetCamera,)
    priority = 8
    answered_once = True

    match: MaterialMatch
    document: Document
    n_bounces: int = 1


@dataclass(frozen=True)
class MatchErrors:
    """How far the matched material is from the original: the error of the BRDF, before it was matched and after
    (`engine.inverse.brdf_fit.MatchedLayer`); and of the picture of the object (`engine.inverse.placed_error`), None
    where no pixel sees it."""

    before: float
    brdf: float
    picture: float | None

    @property
    def text(self) -> str:
        """Both in words."""
        seen = "not in the picture" if self.picture is None else f"{100.0 * self.picture:.1f} % in the picture"
        return f"{100.0 * self.brdf:.1f} % of the BRDF, {seen}"


@dataclass(frozen=True, eq=False)
class MaterialMatched(Response):
    """The matched layer of a `MatchMaterial`, its errors, and the planned bands of its curves."""

    layer: Layer
    errors: MatchErrors
    planned: dict[str, int]


@dataclass(frozen=True)
class MatchProgress(Response):
    """The work has come so far, from 0 to 1; text: what is being done."""

    is_partial = True

    fraction: float
    text: str
