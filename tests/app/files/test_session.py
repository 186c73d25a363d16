"""Sessions come back equal to the last bit; what is wrong in a file is named, and nothing half is ever left."""

import io
import os
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from app.document.commands.curves import AddOperator, CollapseOperators, SetOperators
from app.document.commands.layers import SetFrozen, SetParameter, SetVisible
from app.document.commands.light import SetBackground, SetBackgroundColour, SetEnvironment
from app.document.commands.plan import SetFirstBands
from app.document.described import document_from_description
from app.document.document import Document, Selection
from app.document.view_state import Bookmark, SetView, Viewpoint, ViewState
from app.files.session import Session, load_session, save_session
from app.files.session_fitting import fit_session, session_notes
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator, diagonal
from engine.scene.description import Camera, parse_description
from engine.settings import AS_PLANNED, RenderSettings
from tests.app.fake_worker import SCENE
from tests.app.limits import largest_file

LIFT = Operator("translate", "y", 0.1, 0.2, 1 / 3, 0.4, magnitude=1 / 7, channels=(True, False, True))
SMALL = document_from_description("shelf", parse_description(SCENE, "scene.toml"))


@pytest.fixture
def edited(document: Document) -> Document:
    """A document in which everything that a session holds differs from its default."""
    for command in (
        AddOperator("pot.1", "theta_h", LIFT),
        AddOperator("pot.1", "theta_h", Operator("amplify", "x", 0.0, 0.0, 0.5, 0.5, 1.25, baseline=0.1, muted=True)),
        AddOperator("pot.1", "theta_d", LIFT),
        CollapseOperators("pot.1", "theta_d"),
        AddOperator("pot.0", "theta_o", LIFT),
        SetParameter("pot.1", "eta", (0.1 + 0.2, 1.0, 2.0)),
        SetFrozen("floor", True),
        SetVisible("pot.0", False),
        SetEnvironment("constant", "angular", (1.0, 0.1, 1e-5)),
        SetFirstBands(256),
        SetBackgroundColour((1 / 3, 0.0, 1e-9)),
        SetBackground("transparent"),
    ):
        document = command.apply(document)
    return document


def test_a_session_cut_at_any_line_is_refused(edited: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "whole.insitu", edited, ViewState())
    lines = path.read_text().splitlines(keepends=True)
    for n in range(len(lines)):
        path.write_text("".join(lines[:n]))
        with pytest.raises(LoadError):
            load_session(path)
    # One of before, which did not say where it ends.
    path.write_text("".join(lines[:-1]).replace("ends = true\n", ""))
    assert load_session(path).document == edited


def test_a_session_comes_back_equal(edited: Document, tmp_path: Path) -> None:
    view = ViewState(
        selected=Selection("pot", 1, "theta_d"), exposure=-1 / 3, tone_mapping="agx", settings=RenderSettings(800, 3000)
    )
    path = save_session(tmp_path / "mine", edited, view)
    assert path.name == "mine.insitu"
    session = load_session(path)
    assert session.document == edited and session.view == view and session.journal is None


@settings(max_examples=60, deadline=None)
@given(
    regions=st.tuples(*[st.floats(-10.0, 10.0)] * 4).map(sorted),
    magnitude=st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12),
    rotation=st.floats(0.0, 360.0),
)
def test_any_number_comes_back_to_the_last_bit(
    regions: list[float], magnitude: float, rotation: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    a, b, c, d = regions
    document = AddOperator("pot.1", "theta_h", Operator("translate", "y", a, b, c, d, magnitude)).apply(SMALL)
    document = replace(document, light=replace(document.light, rotation=rotation))
    path = save_session(tmp_path_factory.mktemp("s") / "s.insitu", document, ViewState())
    assert load_session(path).document == document


def test_kept_views_come_back_equal(document: Document, tmp_path: Path) -> None:
    look = Viewpoint(Camera(position=(1 / 3, 1.0, 4.0), target=(0.0, 0.1, 0.0), fov_y=1 / 7), (20, 10))
    picture = io.BytesIO()
    Image.new("RGB", (128, 96), (200, 100, 50)).save(picture, "JPEG")
    bookmarks = (Bookmark("From above", look, picture.getvalue()), Bookmark('Größe 1.5 "x"', Viewpoint()))
    path = save_session(tmp_path / "s.insitu", document, ViewState(bookmarks=bookmarks))
    assert load_session(path).view.bookmarks == bookmarks


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ('name = ""', r"bookmark 0 '': name = .*, expected a name of 1 to 64 characters"),
        ('name = "a"\nthumbnail = "%%%"', r"bookmark 0 'a': thumbnail = %%%, expected a JPEG file"),
        ('name = "a"\nthumbnail = "AAAA"', r"bookmark 0 'a': thumbnail = AAAA, expected a JPEG file"),
        ('name = "a"\nresolution = [0, 5]', r"resolution 0 = 0, expected"),
        ('name = "a"\ncamera = {position = [0, 0, 0], target = [0, 0, 0]}', r"camera: target = .*other than the pos"),
        ('name = "a"\n[[bookmark]]\nname = "a"', r"bookmark = .*, expected names that differ"),
    ],
)
def test_a_damaged_view_is_named_in_one_line(document: Document, tmp_path: Path, line: str, what: str) -> None:
    path = save_session(tmp_path / "s.insitu", document, ViewState())
    path.write_text(path.read_text().replace("[end]", f"[[bookmark]]\n{line}\n[end]"))
    with pytest.raises(LoadError, match=what) as found:
        load_session(path)
    assert "\n" not in str(found.value)


def test_crop_and_pinned_pixels_come_back_equal(document: Document, tmp_path: Path) -> None:
    view = SetView.of(crop=(0.1, 0.2, 0.3, 0.4), probes=((0.5, 0.25),)).apply(ViewState())
    path = save_session(tmp_path / "a.insitu", document, view)
    found = load_session(path).view
    assert found.crop == (0.1, 0.2, 0.3, 0.4) and found.probes == ((0.5, 0.25),)
    path.write_text(path.read_text().replace("0.3", "0.05"))
    with pytest.raises(LoadError, match="crop"):
        load_session(path)


def test_a_diagonal_edit_stays_one_and_others_become_none(tmp_path: Path) -> None:
    pair = diagonal((0.1, 0.2, 0.3, 0.4), 0.01, 0.5)
    for joined in (True, False):
        edits = (replace(pair[0], joined=joined), pair[1])
        document = SetOperators("pot.1", "theta_h", edits).apply(SMALL)
        path = save_session(tmp_path / "s.insitu", document, ViewState())
        assert load_session(path).document == document
        assert ("joined" in path.read_text()) == joined


def test_files_beside_the_session_are_relative_and_move_with_it(document: Document, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    scene, elsewhere = tmp_path / "a" / "scene.toml", tmp_path / "sky.exr"
    document = SetEnvironment(str(elsewhere)).apply(replace(document, source=str(scene)))
    save_session(tmp_path / "a" / "s.insitu", document, ViewState())
    assert 'scene = "scene.toml"' in (tmp_path / "a" / "s.insitu").read_text()
    (tmp_path / "a").rename(tmp_path / "b")
    moved = load_session(tmp_path / "b" / "s.insitu").document
    assert moved.source == str(tmp_path / "b" / "scene.toml") and moved.light.environment == str(elsewhere)


def test_a_scene_file_is_never_overwritten(document: Document, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text("version = 1")
    with pytest.raises(InsituError, match="never overwritten"):
        save_session(scene, document, ViewState())
    assert scene.read_text() == "version = 1"


BASE = """
version = 2
scene = "teatray"
[light]
environment = "scene"
[[object]]
name = "pot"
[[object.layer]]
model = "rough_conductor"
name = "coat"
values = { alpha = 0.2 }
[[object.layer.curve]]
factor = "theta_h"
operator = [{ kind = "translate", axis = "y", regions = [0, 0.1, 0.2, 0.3], magnitude = 1 }]
"""


def test_the_base_of_the_bad_files_is_good(tmp_path: Path) -> None:
    path = tmp_path / "s.insitu"
    path.write_text(BASE)
    layer = load_session(path).document.layer("pot.coat")
    assert layer.operators("theta_h") == (Operator("translate", "y", 0.0, 0.1, 0.2, 0.3, 1.0),)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("version = 2", "version = 3", "version = 3 (made by a newer version)"),
        ("version = 2", "version = '1'", "version = 1, expected 2"),
        ("version = 2", "version = true", "version = True"),
        ("version = 2", "", "version = nothing"),
        ("version = 2", "version = = 2", "TOML"),
        ('scene = "teatray"', "scene = 3", "scene = 3"),
        ('scene = "teatray"', "", "scene = nothing"),
        ("[light]", "colour = 1\n[light]", "colour = 1, expected one of version, ends, scene"),
        ("[light]", "[light]\nrotation = nan", "light: rotation = nan"),
        ("[light]", "[light]\nintensity = 1e999", "light: intensity = inf"),
        ("[light]", "[light]\nintensity = -1", "light: intensity = -1"),
        ("[light]", "[light]\nintensity = true", "light: intensity = True"),
        ("[light]", "[light]\nradiance = [1, 1, 1]", "radiance"),
        ('"scene"\n[[object]]', '"constant"\n[[object]]', "radiance = None"),
        ("[light]", '[light]\nmapping = "dome"', "light: mapping = dome"),
        ("[[object]]", "[view]\nexposure = 'much'\n[[object]]", "view: exposure = much"),
        ("[[object]]", "[view]\nn_lights = 2.5\n[[object]]", "view: n_lights = 2.5"),
        ("[[object]]", "[view]\nn_patches = 7\n[[object]]", "view: n_patches = 7"),
        ("[[object]]", '[[object]]\nname = "pot"\n[[object]]', "object 'pot'"),
        ('name = "pot"', 'name = "a.b"', "object 0 'a.b': name = a.b"),
        ('name = "pot"', 'name = "pot"\nvisible = 1', "object 0 'pot': visible = 1"),
        ('"rough_conductor"', '"velvet"', "pot.0.model = velvet"),
        ("alpha = 0.2", "alpha = 2.0", "pot.0: rough_conductor.alpha = 2.0"),
        ("alpha = 0.2", "alpha = nan", "values: alpha = nan"),
        ("alpha = 0.2", "beta = 0.2", "pot.0: rough_conductor.beta = 0.2"),
        ('factor = "theta_h"', 'factor = "theta_i"', "pot.0: curve = theta_i"),
        ('"translate"', '"rotate"', "operator 0: kind = rotate"),
        ('axis = "y", ', "", "with axis, regions and magnitude"),
        ("0.1, 0.2, 0.3]", "0.2, 0.1, 0.3]", "expected a <= b <= c <= d"),
        ("0.1, 0.2, 0.3]", "0.1, 0.2]", "operator 0: regions 3 = nothing"),
        ("magnitude = 1", "magnitude = inf", "operator 0: magnitude = inf"),
        ("magnitude = 1", "magnitude = 1, muted = 0", "operator 0: muted = 0"),
        ('kind = "translate"', 'kind = "curve"', "0 angles for 0 values"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, old: str, new: str, says: str) -> None:
    path = tmp_path / "s.insitu"
    assert old in BASE
    path.write_text(BASE.replace(old, new, 1))
    with pytest.raises(LoadError) as caught:
        load_session(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ") and says in line and line.endswith("; nothing was changed") and "\n" not in line


def test_one_curve_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "s.insitu"
    path.write_text(BASE + BASE[BASE.index("[[object.layer.curve]]") :])
    with pytest.raises(LoadError, match="curve = theta_h, expected each of theta_h, theta_d once at most"):
        load_session(path)


@pytest.mark.parametrize(
    "content", [b"\xff\xfe", b"", b"[" * 100_000, b"x = [" * 20_000, b"\x00" * 100, bytes(range(128, 192))]
)
def test_anything_at_all_is_refused_in_words(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "s.insitu"
    path.write_bytes(content)
    with pytest.raises(LoadError):
        load_session(path)


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.insitu")
    for name in ("pipe.insitu", "nothing.insitu", "."):
        with pytest.raises(LoadError, match="file = "):
            load_session(tmp_path / name)


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_damaged_session_loads_or_is_refused_in_words(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = bytearray(BASE.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("damaged") / "s.insitu"
    path.write_bytes(text[: data.draw(st.integers(0, len(text)))])
    try:
        document = load_session(path).document
    except LoadError:
        return
    for key, layer in document.layers():
        assert np.isfinite(layer.coefficients(layer.model.factors[0].name, 8)).all(), key


def test_a_session_fits_the_scene_it_was_made_for(edited: Document, document: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "s", edited, ViewState())
    assert fit_session(load_session(path), document, "s.insitu") == edited
    fewer = replace(document, objects=document.objects[:2])
    left = fit_session(load_session(path), fewer, "s.insitu")
    assert left.objects == edited.objects[:2] and [state.name for state in left.absent] == ["lamp"]
    (note,) = session_notes(load_session(path), fewer)
    assert note == "lamp: no longer in the scene; their edits stay in the session"
    # Saved again, it still has what waits for its object.
    again = load_session(save_session(tmp_path / "t", left, ViewState()))
    assert fit_session(again, document, "t.insitu") == edited
    more = replace(document, objects=(*document.objects, replace(document.object("floor"), name="rug")))
    assert fit_session(again, more, "t.insitu").object("rug") == more.object("rug")
    foreign = replace(document, objects=(replace(document.object("floor"), name="rug"),))
    with pytest.raises(LoadError, match="s.insitu: object 'floor' = in the session, expected an object of the scene"):
        fit_session(load_session(path), foreign, "s.insitu")
    other = document.with_object(replace(document.object("pot"), layers=document.object("pot").layers[:1]))
    assert fit_session(load_session(path), other, "s.insitu") == edited  # layers are the session's own


def test_a_full_disk_leaves_the_old_file(edited: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "s", edited, ViewState())
    before = path.read_bytes()
    with largest_file(100), pytest.raises(InsituError, match="what was there is untouched"):
        save_session(path, SetFrozen("floor", False).apply(edited), ViewState())
    assert path.read_bytes() == before


KILL_LOOP = textwrap.dedent("""
    import os, random, signal, sys, time
    from pathlib import Path
    from app.document.commands.light import SetIntensity
    from app.files.session import load_session, save_session
    from app.document.view_state import ViewState

    path, n_kills = Path(sys.argv[1]), int(sys.argv[2])
    document = load_session(path).document
    random.seed(7)
    started = time.monotonic()
    for _ in range(5):
        save_session(path, document, ViewState())
    pace = (time.monotonic() - started) / 5  # of a save on this machine now
    found = set()
    n_done = 0
    # Where saving is quick, all kills may come after a file is in its place: more, till one came before.
    while n_done < n_kills or (len(found) == n_done and n_done < 50 * n_kills):
        i_kill, n_done = n_done, n_done + 1
        begun, begins = os.pipe()
        child = os.fork()
        if child == 0:
            number = 100 * i_kill
            while True:
                if number % 100 == i_kill % 2:  # before its first file, or when that is in its place
                    os.write(begins, b"now")
                number += 1
                save_session(path, SetIntensity(float(number)).apply(document), ViewState())
        os.read(begun, 3)
        if i_kill % 4:  # else at once
            time.sleep(random.uniform(0.0, 4.0 * pace))
        os.close(begun)
        os.close(begins)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        found.add(load_session(path).document.light.intensity)  # raises when half a file is there
    left = [entry.name for entry in path.parent.iterdir() if entry != path]
    assert len(left) <= 1, left  # what the last child was writing
    # Some kills came before, some after the file was in its place.
    assert n_done // 20 < len(found) < n_done, found
""")


@pytest.mark.parametrize("n_kills", [20, pytest.param(250, marks=pytest.mark.sweep)])
def test_killed_while_saving_leaves_the_old_or_the_new_file(tmp_path: Path, n_kills: int) -> None:
    folder = tmp_path / "alone"
    folder.mkdir()
    path = save_session(folder / "s", SMALL, ViewState())
    done = subprocess.run(
        [sys.executable, "-c", KILL_LOOP, str(path), str(n_kills)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr


def test_bounces_as_planned_stay_so(tmp_path: Path, document: Document) -> None:
    view = SetView.of(n_bounces=AS_PLANNED).apply(ViewState())
    assert load_session(save_session(tmp_path / "s", document, view)).view.settings.n_bounces == AS_PLANNED


def test_a_session_that_calls_parts_by_their_numbers_fits(document: Document) -> None:
    former = {"pot": "pots 1", "floor": "pots 2"}
    scene = replace(document, objects=tuple(replace(o, former_name=former.get(o.name, "")) for o in document.objects))
    saved = tuple(replace(o, name=former.get(o.name, o.name), visible=o.name != "pot") for o in document.objects)
    session = Session(replace(document, objects=saved), ViewState())
    found = fit_session(session, scene, "old.insitu")
    assert [o.name for o in found.objects] == [o.name for o in document.objects] and not found.absent
    assert not found.object("pot").visible and session_notes(session, scene) == ()
