"""Formulas of the layers whose sharp gloss is reflected pixel by pixel, for `shaders/orbit/sharp.glsl`."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from engine.material.layer import Layer
from engine.material.measured import MeasuredModel
from engine.realtime.core.gpu_parts import OrbitTerm
from ui.gl.brdf_stack import BrdfStack, LayerShape, brdf_source
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes
from ui.gl.python_to_glsl import Untranslatable


class SharpGloss:
    """A stack of layers for each term with sharp gloss that has a formula on the graphics card. What has none, as
    measured layers, whose tables are not uploaded for this, reflects peaks by slices."""

    def __init__(self, context: moderngl.Context) -> None:
        self._passes, self._textures = Passes(context), TextureMemory(context)
        self._stacks: list[BrdfStack] = []
        self._terms: tuple[OrbitTerm, ...] = ()
        self._by_term: dict[int, BrdfStack] = {}

    def follow(self, terms: tuple[OrbitTerm, ...]) -> None:
        """Follow the terms that are drawn. Raises GraphicsError where there is no room."""
        if terms is self._terms:
            return
        with_formula = [i for i, term in enumerate(terms) if term.sharp and _has_formula(term.sharp)]
        while len(self._stacks) > len(with_formula):
            self._stacks.pop().release()
        while len(self._stacks) < len(with_formula):
            self._stacks.append(BrdfStack(self._passes, self._textures))
        for i, stack in zip(with_formula, self._stacks, strict=True):
            stack.set_layers(terms[i].sharp)
        self._terms, self._by_term = terms, dict(zip(with_formula, self._stacks, strict=True))

    def stack(self, i_term: int) -> BrdfStack | None:
        """The stack of a term; None for one without a formula."""
        return self._by_term.get(i_term)

    @property
    def memory_bytes(self) -> int:
        """Bytes of the textures."""
        return self._textures.bytes_in_use

    def release(self) -> None:
        """Free all."""
        self.follow(())
        self._passes.release()


def _has_formula(layers: Sequence[Layer]) -> bool:
    if any(isinstance(layer.model, MeasuredModel) for layer in layers):
        return False
    try:
        brdf_source(tuple(LayerShape(layer.model, layer.has_view_curve, None) for layer in layers))
    except Untranslatable:
        return False
    return True
