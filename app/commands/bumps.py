"""Edits of an object's normal or bump map (`engine.material.bumps`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document import Document
from engine.errors import InsituError
from engine.material.bumps import set_bump_field


@dataclass(frozen=True)
class SetBumps:
    """Give a part of what turns an object's normals a value; an image's name of "" takes it away."""

    object: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.object} {self.name.replace('_', ' ')}"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        if state.frozen:
            raise InsituError(f"{self.object} is frozen; thaw it to edit it")
        if state.emits:
            raise InsituError(f"{self.object} shines; only what reflects has bumps")
        bumps = set_bump_field(state.bumps, self.name, self.value)
        return document.with_object(replace(state, new_bumps=None if bumps == state.own_bumps else bumps))
