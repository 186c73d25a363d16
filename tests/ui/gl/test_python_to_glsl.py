"""The translation of plain Python to GLSL: all it knows gives Python's numbers, all else is refused by name."""

import math
from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Passes
from ui.gl.python_functions import PythonSource
from ui.gl.python_to_glsl import Translation, Untranslatable, literal

LANGUAGE = '''
import math
from engine.material import kinds

HALF = 0.5
ONE, TWO = kinds.PHONG, 2 * kinds.PHONG
TINY = 1e-300


def half(x: float) -> float:
    """Named as a word that GLSL keeps for itself."""
    return HALF * x


def pick(kind: int, q: Float64Array, x: float) -> float:
    if kind == ONE:
        return q[ONE] * x
    elif kind == TWO and ONE == 1:
        return q[7]
    return 0.0


def whole(q: Float64Array, x: float, y: float) -> float:
    a, b = half(x) + TINY, y
    a, b = b, a
    low = x < 0.0 or not y <= 0.25
    if low:
        c = min(a, b, 0.1)
    else:
        c = max(a, -b)
        c += 1.0
    c *= 2
    d = c if 0.0 < x < 0.5 else abs(c) - x ** 2
    return d + pick(ONE, q, x) + pick(2, q, y)
'''
Q = (0.5, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0)
FUNCTIONS = {
    "exp": (-80.0, 80.0), "expm1": (-1.0, 1.0), "log": (1e-30, 1e30), "log1p": (-0.999, 2.0), "sqrt": (0.0, 9.0),
    "atan": (-50.0, 50.0), "acos": (-1.0, 1.0), "asin": (-1.0, 1.0), "sin": (-3.0, 3.0), "cos": (-3.0, 3.0),
    "tan": (-1.5, 1.5), "fabs": (-1.0, 1.0), "floor": (-3.0, 3.0), "ceil": (-3.0, 3.0),
}  # fmt: skip
TWO_SIDED = {"atan2": (-2.0, 2.0), "pow": (0.0, 3.0), "hypot": (-2.0, 2.0)}
VALUES = """#version 410 core
#include "brdf/arithmetic.glsl"
uniform sampler2D given;
layout(location = 0) out vec4 value;
{text}
const mat2x4 Q = mat2x4({numbers});
void main() {{
    vec4 xy = texelFetch(given, ivec2(gl_FragCoord.xy), 0);
    value = vec4({call}, 0.0, 0.0, 0.0);
}}
"""


@pytest.fixture
def source(tmp_path: Path) -> PythonSource:
    file = tmp_path / "language.py"
    file.write_text(LANGUAGE, encoding="utf-8")
    return PythonSource.read(file)


@pytest.fixture
def passes(context: moderngl.Context) -> Iterator[Passes]:
    made = Passes(context)
    yield made
    made.release()


def computed(passes: Passes, text: str, call: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A GLSL expression of xy, (N,)."""
    memory = TextureMemory(passes.context)
    given = np.zeros((len(x), 4), np.float32)
    given[:, 0], given[:, 1] = x, y
    textures = [memory.texture((len(x), 1), 4, "f4", given), memory.texture((len(x), 1), 4, "f4")]
    target = memory.framebuffer(textures[1:])
    body = VALUES.format(text=text, call=call, numbers=", ".join(map(str, Q)))
    program = passes.full_screen("made/values.glsl", {"made/values.glsl": body})
    passes.draw(program, target, (0, 0, len(x), 1), {"given": textures[0]})
    found = read_texture(textures[1], np.float32)[0, :, 0].astype(np.float64)
    memory.release_framebuffer(target)
    for texture in textures:
        memory.release(texture)
    return found


def test_the_language_means_what_it_means_in_python(source: PythonSource, passes: Passes) -> None:
    translation = Translation()
    name = translation.function(source, "whole", {}, {})
    x, y = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 400)).astype(np.float32).astype(np.float64)
    scope: dict[str, object] = {}
    exec(compile(LANGUAGE.replace(": Float64Array", ""), "language.py", "exec"), scope)  # noqa: S102  the text above
    expected = [scope["whole"](Q, *pair) for pair in zip(x, y, strict=True)]  # type: ignore[operator]
    found = computed(passes, translation.text, f"{name}(Q, xy.x, xy.y)", x, y)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", [*FUNCTIONS, *TWO_SIDED])
def test_functions_of_math_to_single_precision(tmp_path: Path, passes: Passes, name: str) -> None:
    # Relative to the value, or to what the rounding of the argument makes of it: 4e-7, some seven units of the last
    # place; llvmpipe's sine and tangent are the driver's own.
    arguments = "x, y" if name in TWO_SIDED else "x"
    (tmp_path / "one.py").write_text(
        f"import math\ndef one(x: float, y: float) -> float:\n    return math.{name}({arguments})\n", encoding="utf-8"
    )
    translation = Translation()
    function = translation.function(PythonSource.read(tmp_path / "one.py"), "one", {}, {})
    low, high = (FUNCTIONS | TWO_SIDED)[name]
    spread = np.geomspace if name == "log" else np.linspace
    x = spread(low, high, 1001).astype(np.float32).astype(np.float64)
    y = np.random.default_rng(2).uniform(low, high, 1001).astype(np.float32).astype(np.float64)
    if name == "log1p":
        x = np.concatenate([x, np.geomspace(1e-12, 0.1, 200), -np.geomspace(1e-12, 0.1, 200)]).astype(np.float32)
        y, x = np.zeros(len(x)), x.astype(np.float64)
    given = [((a, b) if name in TWO_SIDED else (a,)) for a, b in zip(x, y, strict=True)]
    expected = np.array([getattr(math, name)(*each) for each in given])
    found = computed(passes, translation.text, f"{function}(xy.x, xy.y)", x, y)
    slack = 2e-5 if name in ("sin", "cos", "tan") else 4e-7
    largest = 1e-5 if name == "exp" else slack  # e^80: its argument's last place is 4e-6
    np.testing.assert_allclose(found, expected, rtol=max(slack, largest), atol=slack)


def test_what_an_argument_is_known_to_be_leaves_branches_out(source: PythonSource) -> None:
    first, second = Translation(), Translation()
    first.function(source, "pick", {"kind": 1}, {})
    second.function(source, "pick", {"kind": 2}, {})
    assert "v_q[0][1]" in first.text and "if" not in first.text
    assert "v_q[1][3]" in second.text and "v_x *" not in second.text


def test_constants_below_single_precision_do_not_vanish() -> None:
    assert float(np.float32(literal(1e-300))) > 0.0 and literal(0.0) == "0.0" and literal(-2.0) == "(-2.0)"
    with pytest.raises(Untranslatable, match="1e\\+300 is beyond single precision"):
        literal(1e300)


REFUSED = {
    "for each in range(3):\n        x += each\n    return x": "For",
    "return math.gamma(x)": "a call of math.gamma",
    "return len(x)": "a call of len",
    "return x % 2.0": "x % 2.0",
    "return unknown + x": "unknown, which is neither a variable nor a number",
    "return q[9]": "a place among the parameters",
    "return q[x]": "a place among the parameters",
    "return min(x, key=x)": "named or starred arguments",
    "x[0] = 1.0\n    return x": "Assign",
    "return x in x": "x in x",
    "q = x\n    return x": "an assignment to the argument q",
    "y = x < 1.0\n    y = 2.0\n    return y": "a condition here and a number elsewhere",
}


@pytest.mark.parametrize("body", REFUSED)
def test_what_has_no_counterpart_is_named(tmp_path: Path, body: str) -> None:
    file = tmp_path / "velour.py"
    source = f"import math\n\n\ndef quotient(q: Float64Array, x: float) -> float:\n    {body}\n"
    file.write_text(source, encoding="utf-8")
    with pytest.raises(Untranslatable) as refused:
        Translation().function(PythonSource.read(file), "quotient", {}, {})
    assert "velour.py:" in str(refused.value) and REFUSED[body] in str(refused.value)
    with pytest.raises(Untranslatable, match="there is no function glaze"):
        Translation().function(PythonSource.read(file), "glaze", {}, {})
