"""Patterns of MaterialX against the library's own GLSL, which the installed package has."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from engine.scene.loaders.graph_noise import pattern
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Passes

pytest.importorskip("MaterialX")
SHADER = """#version 410 core
{library}
uniform sampler2D given;
layout(location = 0) out vec4 value;
void main() {{
    vec3 p = texelFetch(given, ivec2(gl_FragCoord.xy), 0).xyz;
    value = vec4(0.0);
    {channels} = {call};
}}
"""
ONE, OCTAVES = np.ones((1, 1), np.float32), np.full((1, 1), 4, np.float32)
LACUNARITY, DIMINISH = np.full((1, 1), 2.1, np.float32), np.full((1, 1), 0.6, np.float32)
JITTER, DISTANCE, SOLID = np.full((1, 1), 0.8, np.float32), np.zeros((1, 1), np.float32), ONE
NOISE, FRACTAL = (ONE, 0.0 * ONE), (ONE, OCTAVES, LACUNARITY, DIMINISH)
CALLS = [
    ("cellnoise2d", 1, (), "mx_cell_noise_float(p.xy)"),
    ("cellnoise3d", 1, (), "mx_cell_noise_float(p)"),
    ("noise2d", 1, NOISE, "mx_perlin_noise_float(p.xy)"),
    ("noise2d", 3, NOISE, "mx_perlin_noise_vec3(p.xy)"),
    ("noise2d", 4, NOISE, "vec4(mx_perlin_noise_vec3(p.xy), mx_perlin_noise_float(p.xy + vec2(19, 73)))"),
    ("noise3d", 1, NOISE, "mx_perlin_noise_float(p)"),
    ("noise3d", 2, NOISE, "mx_perlin_noise_vec3(p).xy"),
    ("noise3d", 4, NOISE, "vec4(mx_perlin_noise_vec3(p), mx_perlin_noise_float(p + vec3(19, 73, 29)))"),
    ("fractal2d", 1, FRACTAL, "mx_fractal2d_noise_float(p.xy, 4, 2.1, 0.6)"),
    ("fractal2d", 2, FRACTAL, "mx_fractal2d_noise_vec2(p.xy, 4, 2.1, 0.6)"),
    ("fractal3d", 3, FRACTAL, "mx_fractal3d_noise_vec3(p, 4, 2.1, 0.6)"),
    ("fractal3d", 4, FRACTAL, "mx_fractal3d_noise_vec4(p, 4, 2.1, 0.6)"),
    *[(f"worleynoise{n_axes}d", n, (JITTER, style), f"mx_worley_noise_{kind}({p}, 0.8, {k}, 0)")
      for n_axes, p in ((2, "p.xy"), (3, "p")) for n, kind in ((1, "float"), (2, "vec2"), (3, "vec3"))
      for k, style in enumerate((DISTANCE, SOLID))],
]  # fmt: skip


@pytest.fixture
def passes(context: moderngl.Context) -> Iterator[Passes]:
    made = Passes(context)
    yield made
    made.release()


def theirs(passes: Passes, n: int, call: str, places: np.ndarray) -> np.ndarray:
    """A call of the library's functions of p, (N, n)."""
    found = importlib.util.find_spec("MaterialX")
    assert found is not None
    assert found.origin is not None
    library = Path(found.origin).parent / "libraries" / "stdlib" / "genglsl" / "lib" / "mx_noise.glsl"
    body = SHADER.format(library=library.read_text(encoding="utf-8"), channels=f"value.{'xyzw'[:n]}", call=call)
    memory = TextureMemory(passes.context)
    given = np.concatenate([places, np.zeros((len(places), 1))], axis=1).astype(np.float32)
    textures = [memory.texture((len(places), 1), 4, "f4", given), memory.texture((len(places), 1), 4, "f4")]
    target = memory.framebuffer(textures[1:])
    program = passes.full_screen("made/values.glsl", {"made/values.glsl": body})
    passes.draw(program, target, (0, 0, len(places), 1), {"given": textures[0]})
    values = read_texture(textures[1], np.float32)[0, :, :n].copy()
    memory.release_framebuffer(target)
    for texture in textures:
        memory.release(texture)
    return values


@pytest.mark.parametrize(("category", "n", "inputs", "call"), CALLS)
def test_patterns_are_those_of_the_library(
    passes: Passes, category: str, n: int, inputs: tuple[np.ndarray, ...], call: str
) -> None:
    places = np.random.default_rng(5).uniform(-9.0, 9.0, (2000, 3)).astype(np.float32)
    ours = pattern(category, n, places[:, : int(category[-2])], *inputs)
    expected = theirs(passes, n, call, places)
    # Cells are integers alone, and equal. Others are sums, which a graphics card may contract: some units of the last
    # place, of values up to 2; a cell that two points are equally near to may be the other one.
    if category.startswith("cell"):
        np.testing.assert_array_equal(ours, expected)
    elif inputs[-1] is SOLID and category.startswith("worley"):
        assert (ours != expected).any(axis=1).mean() < 2e-3
    else:
        np.testing.assert_allclose(ours, expected, atol=4e-6)
