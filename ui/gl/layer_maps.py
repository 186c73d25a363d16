"""The uniforms of a layer's images and strokes (`shaders/common/maps.glsl`)."""

from __future__ import annotations

from engine.texture.gpu_export import ExportedMaps


def map_uniforms(maps: ExportedMaps) -> dict[str, object]:
    return {
        "tint": maps.texture, "tint_repeats": maps.scale, "tint_strength": maps.strength, "weight": maps.weight,
        "weight_start": maps.start, "inverts": maps.inverts, "strokes": maps.strokes,
    }  # fmt: skip
