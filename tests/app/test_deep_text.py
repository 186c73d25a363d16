"""Text that would cost too much to read is refused by every way in: scenes, sessions, journals, materials, scripts."""

from pathlib import Path

import pytest

from app.files.journal import Recovery
from app.files.materials import load_material, parse_material
from app.files.session import load_session
from app.operators.script import load_script
from app.project.assignments import parse_assignment
from engine.core.errors import LoadError
from engine.scene.description import load_description
from engine.scene.toml_text import MAX_LEVELS, MAX_PARTS

WAYS_IN = {
    "scene": load_description,
    "session": load_session,
    "journal": lambda path: Recovery(path, "", 0.0).load(),
    "material": load_material,
    "copied material": lambda path: parse_material(path.read_text(), "clipboard"),
    "script": load_script,
}


@pytest.mark.parametrize("way", WAYS_IN)
@pytest.mark.parametrize("n_dots", [2_000, 30_000, 200_000])
@pytest.mark.parametrize("form", ["{} = 1", "[{}]", "version = 1\nlayer = [{{ {} = 1 }}]"])
def test_a_key_with_thousands_of_dots_is_one_line(tmp_path, way, n_dots, form):
    path = tmp_path / "deep.toml"
    path.write_text(form.format("a" + ".a" * n_dots))
    with pytest.raises(LoadError) as caught:
        WAYS_IN[way](path)
    assert len(str(caught.value)) < 400 and "\n" not in str(caught.value)


@pytest.mark.parametrize("way", WAYS_IN)
def test_the_deepest_tree_that_is_read_is_one_line_too(tmp_path, way):
    keys = ".".join(["a"] * MAX_PARTS)
    path = tmp_path / "deep.toml"
    path.write_text("version = 1\n" + f"{keys} = {{ " * MAX_LEVELS + "a = 1" + " }" * MAX_LEVELS)
    with pytest.raises(LoadError) as caught:
        WAYS_IN[way](path)
    assert len(str(caught.value)) < 400 and "\n" not in str(caught.value)


@pytest.mark.parametrize("value", ["{a=" * 2_000, "[" * 100_000, "{" + "a." * 2_000 + "a=1}", "9" * 5_000])
def test_a_value_on_the_command_line_is_a_word_when_it_cannot_be_read(value):
    assert parse_assignment(f"teapot.0.alpha={value}") == ("teapot.0.alpha", value)


def test_there_is_one_way_in():
    root = Path(__file__).resolve().parents[2]
    files = (file for folder in ("app", "engine", "ui") for file in (root / folder).rglob("*.py"))
    users = {file.relative_to(root).as_posix() for file in files if "tomllib" in file.read_text(encoding="utf-8")}
    assert users == {"engine/scene/toml_text.py"}
