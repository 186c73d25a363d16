"""Sessions, scripts and command lines of earlier versions, with the names that they used, still open."""

from pathlib import Path

import pytest

from app.document.document import Document
from app.document.view_state import SetView, ViewState
from app.files.session import load_session, save_session
from app.operators.script import Step, load_script
from engine.core.errors import LoadError
from tests.app.cli.command_line import SCENE, run

VIEW = SetView.of(n_hemisphere_rays=256).apply(ViewState())


@pytest.fixture
def old_session(document: Document, tmp_path: Path) -> Path:
    """A session as version 1 wrote it."""
    text = save_session(tmp_path / "old.insitu", document, VIEW).read_text()
    assert "version = 2\n" in text and "[overrides]\n" in text and "n_hemisphere_rays = 256\n" in text
    text = text.replace("version = 2\n", "version = 1\n").replace("n_hemisphere_rays", "n_fan_rays")
    text = text.replace("[overrides]\n", '[overrule]\nlights = 1000\nprecision = "float"\n')
    (tmp_path / "old.insitu").write_text(text)
    return tmp_path / "old.insitu"


def test_a_session_of_version_1_opens_and_is_saved_with_the_present_names(old_session: Path) -> None:
    found = load_session(old_session)
    assert found.document.overrides == (("lights", 1000), ("precision", "float"))
    assert found.view.settings.n_hemisphere_rays == 256
    text = save_session(old_session, found.document, found.view).read_text()
    assert "overrule" not in text and "n_fan_rays" not in text
    assert load_session(old_session).document == found.document


def test_a_session_of_version_2_has_no_old_names(old_session: Path) -> None:
    old_session.write_text(old_session.read_text().replace("version = 1\n", "version = 2\n"))
    with pytest.raises(LoadError, match="n_fan_rays = 256, expected one of"):
        load_session(old_session)


def test_a_name_given_both_ways_is_refused(old_session: Path) -> None:
    old_session.write_text(old_session.read_text().replace("[overrule]\n", "[overrides]\n[overrule]\n"))
    with pytest.raises(LoadError, match="overrule"):
        load_session(old_session)


def test_an_old_script_is_read(tmp_path: Path) -> None:
    path = tmp_path / "old.toml"
    path.write_text(
        '[[step]]\noverrule = { lights = 1000 }\n[[step]]\nkeep = "Spout"\n[[step]]\nwait = "judged"\n'
        '[[step]]\nwait = "exact"\n'
    )
    assert load_script(path) == (
        Step("override", {"lights": 1000}), Step("save_view", "Spout"), Step("wait", "error"), Step("wait", "exact")
    )  # fmt: skip


@pytest.mark.parametrize("option", [("--overrule", "ball.0.theta_i=4"), ("--overrule=ball.0.theta_i=4",)])
def test_an_old_command_line_is_carried_out(
    tmp_path: Path, option: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ball.toml").write_text(SCENE)
    assert run("plan", tmp_path / "ball.toml", *option) == 0
    assert capsys.readouterr().out.splitlines()[0].split()[:3] == ["ball.0.theta_i", "4", "bands"]


def test_help_shows_the_present_option_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("plan", "--help") == 0
    said = capsys.readouterr().out
    assert "--override" in said and "--overrule" not in said
