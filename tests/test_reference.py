"""The pages of docs/reference say what the program takes now."""

from scripts import write_reference


def test_pages_are_current() -> None:
    outdated = list(write_reference.outdated())
    assert not outdated, "run .venv/bin/python -m scripts.write_reference"


def test_an_option_that_changes_makes_its_page_outdated(monkeypatch) -> None:
    (info,) = [each for each in write_reference.cli.registered_commands if each.callback.__name__ == "doctor"]
    monkeypatch.setattr(info, "help", "Say something else.")
    assert list(write_reference.outdated()) == ["command-line.md"]


def test_a_key_without_a_description_is_refused(monkeypatch) -> None:
    meanings = {"SceneDescription": {"version": "1."}}
    assert write_reference._meaning(meanings, write_reference.SceneDescription, "version") == "1."
    try:
        write_reference._meaning(meanings, write_reference.SceneDescription, "name")
    except SystemExit as error:
        assert "SceneDescription.name" in str(error)
    else:
        raise AssertionError("a key without a description was written")
