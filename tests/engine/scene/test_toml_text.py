"""TOML: the same tree as the parser's own, or one line of error, at a cost proportional to the text."""

import tomllib
import tracemalloc

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from engine.core.errors import LoadError
from engine.scene.toml_text import MAX_LEVELS, MAX_PARTS, MAX_WORD, parse_toml, toml_lines

SMALLEST_BUDGET = 4 << 20


def refusal(text: str) -> str:
    with pytest.raises(LoadError) as caught:
        parse_toml(text, "scene.toml")
    return str(caught.value)


def dotted(part: str, n_dots: int) -> str:
    return ".".join([part] * (n_dots + 1))


@pytest.mark.parametrize("n_dots", [MAX_PARTS, 2_000, 30_000, 200_000])
@pytest.mark.parametrize("part", ["a", '"a.b"', "'a'", '"\\""'])
@pytest.mark.parametrize("form", ["{} = 1", "[{}]", "[[{}]]", "[a]\nb = {{ {} = 1 }}", "b = [\n  {{ {} = 1 }},\n]"])
def test_a_key_of_many_parts_is_one_line_and_costs_little(form, part, n_dots):
    text = "# first\n" + form.format(dotted(part, n_dots))
    tracemalloc.start()
    try:
        line = refusal(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert line.startswith("scene.toml: line ") and f"expected at most {MAX_PARTS} parts; nothing" in line
    assert ": key = " in line and len(line) < 200
    assert peak < SMALLEST_BUDGET  # the parser alone takes 3.6 GB for 30,000


def test_spaces_around_dots_hide_none():
    assert ": key = a . a" in refusal(" . ".join(["a"] * 2_000) + " = 1")


@pytest.mark.parametrize("n_levels", [MAX_LEVELS + 1, 2_000, 200_000])
@pytest.mark.parametrize(("opening", "inner", "closing"), [("[", "", "]"), ("{a=", "1", "}"), ("[\n", "", "\n]")])
def test_deep_brackets_are_one_line(opening, inner, closing, n_levels):
    line = refusal("a = " + opening * n_levels + inner + closing * n_levels)
    assert ": brackets = " in line and f"at most {MAX_LEVELS} in each other" in line
    assert ": brackets = " in refusal("a = " + opening * n_levels)  # unclosed as well


def test_a_number_without_end_is_refused():
    """Printing 0xfff… in a complaint would raise: Python converts no more than 4,300 digits."""
    assert ": word = 0xfff" in refusal("version = 0x" + "f" * 5_000)
    assert ": word = aaa" in refusal("a" * (MAX_WORD + 1) + " = 1")


@pytest.mark.parametrize(
    "text",
    [
        'a = "{}"',
        "a = '{}'",
        'a = """{}"""',
        "a = '''{}'''",
        'a = """\n""{}"\\"""{}"""""',
        "a = '''\n''{}''{}'''''",
        "a = 1 # {}",
        'a = 1 # " {}\nb = 2 # """ {}',
        "# ' {}\na = 1",
        '"{}" = 1',
        'a = "\\"{}"\nb."{}" = 1',
    ],
)
@pytest.mark.parametrize("many", ["." * 1_000, "[" * 1_000, "{a=" * 1_000, "b" * 10_000])
def test_strings_and_comments_may_hold_anything(text, many):
    text = text.replace("{}", many)
    assert parse_toml(text, "f") == tomllib.loads(text)


def test_as_much_as_is_allowed_reads():
    keys = dotted("a", MAX_PARTS - 1)
    text = f"[{keys}]\n{keys} = {'[' * MAX_LEVELS}{']' * MAX_LEVELS}\nb = 1.5\nc = {{ {keys}.d = 1 }}"
    assert refusal(text)
    assert parse_toml(text.replace(f"{keys}.d", keys), "f") == tomllib.loads(text.replace(f"{keys}.d", keys))
    assert parse_toml("a = [" + "1.5, " * 1_000 + "]\n" + "b.c.d = 1\n" * 1, "f")["b"] == {"c": {"d": 1}}


VALUES = st.recursive(
    st.text() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.booleans(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(st.dictionaries(st.text(), VALUES, max_size=6))
def test_what_is_written_reads_the_same(values):
    text = "\n".join(toml_lines(values))
    assert parse_toml(text, "f") == tomllib.loads(text) == values


@given(st.text(alphabet="a=.\"'\\\n#[]{},1 ", max_size=30))
@example('a="""\\')
@example("a='''b''''")
def test_any_short_text_is_what_the_parser_says(text):
    """Thirty characters hold no key and no brackets that are refused: a string taken for something else would show."""
    try:
        tree = tomllib.loads(text)
    except ValueError:
        with pytest.raises(LoadError):
            parse_toml(text, "f")
    else:
        assert parse_toml(text, "f") == tree


@pytest.mark.parametrize("opening", ['"""a', "'''a", '"\\"', "'a", '"""\\', '"a\n', "'a\n", '"""\\"""a', "#"])
def test_unclosed_strings_are_looked_at_once(opening):
    """A second look from each quote would take some minutes here."""
    assert "TOML = " in refusal("a = " + opening * 100_000)
