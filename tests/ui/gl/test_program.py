"""Shader files: includes, switches, line numbers, and what their heads must say."""

from pathlib import Path
from types import SimpleNamespace

import moderngl
import pytest

from ui.gl import context as context_module
from ui.gl.context import GraphicsError, create_headless_context
from ui.gl.program import SHADER_FOLDER, ProgramCache, load_shader

OWN_FOLDERS = ("brdf", "common", "orbit", "placement")


def test_includes_are_taken_once_and_switches_follow_the_version(tmp_path: Path) -> None:
    (tmp_path / "a.glsl").write_text('#version 410 core\n#include "b.glsl"\n#include "c.glsl"\nvoid main() {}\n')
    (tmp_path / "b.glsl").write_text('#include "c.glsl"\nfloat b;\n')
    (tmp_path / "c.glsl").write_text("float c;\n")
    source = load_shader("a.glsl", {"HALF": 1}, folder=tmp_path)
    assert source.startswith("#version 410 core\n#define HALF 1\n#line 2\n")
    assert source.count("float c;") == 1 and source.index("float c;") < source.index("float b;")
    # main stands on line 4 of its file; the include before it is there already and leaves an empty line 3.
    assert source.endswith("#line 3\n\nvoid main() {}\n")


def test_a_missing_include_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.glsl").write_text('#version 410 core\n#include "nowhere.glsl"\n')
    with pytest.raises(GraphicsError, match="nowhere.glsl"):
        load_shader("a.glsl", folder=tmp_path)


def test_a_compiler_error_names_the_file(context: moderngl.Context) -> None:
    # "#define main 0" leaves no function behind.
    with pytest.raises(GraphicsError, match="increment.frag.glsl"):
        ProgramCache(context).get("common/full_screen.vert.glsl", "placement/increment.frag.glsl", HALF=2, main=0)


@pytest.mark.parametrize("folder", OWN_FOLDERS)
def test_every_shader_says_what_it_provides(folder: str) -> None:
    for path in sorted((SHADER_FOLDER / folder).glob("*.glsl")):
        head = [line for line in path.read_text().splitlines() if not line.startswith("#version")][0]
        assert head.startswith("// "), path.name
        stages = (".vert.glsl", ".frag.glsl", ".comp.glsl")
        newer = folder == "orbit" and path.name != "blend.frag.glsl"  # what is drawn without them where OpenGL is older
        version = f"#version {430 if newer else 410} core\n"
        assert path.read_text().startswith(version) == path.name.endswith(stages), path.name


@pytest.mark.parametrize(("newest", "asked"), [(460, [430]), (430, [430]), (410, [430, 410]), (330, [430, 410])])
def test_what_all_shaders_need_is_asked_for_first(
    newest: int, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As NVIDIA's driver has it: a context is of the version that is asked for."""
    versions = list[int]()
    limits = dict.fromkeys(context_module._REQUIRED_LIMITS, 1 << 20)

    def create(standalone: bool, require: int, backend: str) -> SimpleNamespace:
        versions.append(require)
        if require > newest:
            raise ValueError("no such version")
        return SimpleNamespace(version_code=require, info=limits)

    monkeypatch.setattr(context_module.moderngl, "create_context", create)
    if newest >= 410:
        assert create_headless_context().version_code == asked[-1]
    else:
        with pytest.raises(GraphicsError, match=r"4\.1 core is needed.*no such version"):
            create_headless_context()
    assert versions == asked


def test_a_newer_opengl_than_there_is_says_what_is_needed() -> None:
    # No driver offers 9.9: the message names the version and what to install.
    with pytest.raises(GraphicsError, match=r"OpenGL 9\.9 core is needed.*install"):
        create_headless_context(require=999)
