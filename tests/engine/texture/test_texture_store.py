"""The images of a scene: how long they are kept."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.material.layer_maps import ChannelImage, ChannelWeight, LayerMaps, TextureTransform
from engine.texture.texture_store import TextureStore


@pytest.mark.parametrize("rotation", [0.0, 30.0])
def test_statistics_and_textures_of_nodes_keep_no_image_alive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rotation: float
) -> None:
    monkeypatch.setattr("engine.texture.texture_store.MOST_BYTES", 1)  # the last image, whatever its size
    for k, name in enumerate(("rough.png", "other.png")):
        Image.fromarray(np.full((8, 8), 50 * (k + 1), np.uint8)).save(tmp_path / name)
    store = TextureStore(tmp_path / "scene.toml")
    rough = ChannelImage("rough.png", transform=TextureTransform(rotation))
    node = LayerMaps(node_weights=(ChannelWeight(rough, (0.0, 1.0), (0.0, 1.0), (0.0, 1.0)),)).images
    statistics, texture, image = store.channel_statistics(rough), store.texture(node), weakref.ref(store.numbers(rough))
    assert texture is not None and store.texture(node) is texture and store.channel_statistics(rough) is statistics
    store.numbers(ChannelImage("other.png"))
    gc.collect()
    assert image() is None
    again = store.texture(node)
    assert again is not None and again.mean.tolist() == texture.mean.tolist()
    assert store.channel_statistics(rough) == statistics
