"""The pages of docs/reference say what the program takes now."""

import pytest

from app.cli.options import LIGHTS
from engine.scene.description import CameraDescription
from scripts import write_reference


def test_pages_are_current() -> None:
    outdated = list(write_reference.outdated())
    assert not outdated, "run .venv/bin/python -m scripts.write_reference"


@pytest.mark.parametrize(
    ("changed", "name", "value", "page"),
    [
        (LIGHTS, "help", "Something else.", "command-line.md"),
        (LIGHTS, "max", 7, "command-line.md"),
        (CameraDescription.model_fields["fov_y"], "default", 50.0, "scene-file.md"),
    ],
)
def test_what_changes_makes_its_page_outdated(
    monkeypatch, changed: object, name: str, value: object, page: str
) -> None:
    monkeypatch.setattr(changed, name, value)
    assert list(write_reference.outdated()) == [page]


def test_a_key_without_a_description_is_refused() -> None:
    meanings = {"CameraDescription": {"up": "What is up."}}
    assert write_reference._meaning(meanings, CameraDescription, "up") == "What is up."
    with pytest.raises(SystemExit, match="CameraDescription.target"):
        write_reference._meaning(meanings, CameraDescription, "target")


def test_every_table_of_a_step_has_its_section() -> None:
    page = dict(write_reference.pages())["script-file.md"]
    names = [row.split("`")[1] for row in page.splitlines() if row.startswith("| `") and "see below" in row]
    assert len(names) > 15
    assert not [name for name in names if f"## {name}\n" not in page and name != "step"]
