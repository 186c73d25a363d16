import pickle

from engine.errors import InsituError, LoadError


def test_a_load_error_is_one_line_with_file_place_value_and_expectation():
    error = LoadError("a/scene.toml", "camera: fov_y", -3, "a number from 0.01 to 179")
    assert isinstance(error, InsituError)
    # the wording every loader shares
    assert str(error) == (
        "a/scene.toml: camera: fov_y = -3, expected a number from 0.01 to 179; nothing was changed"
    )


def test_values_stay_short_printable_and_on_one_line():
    error = LoadError("f", "line 1", "x\n\x1b[31m" + "y" * 500, "text")
    assert str(error).isprintable()  # no line break, no terminal sequence
    assert len(str(error)) < 200  # the value is cut at 80 characters


def test_a_load_error_survives_pickling():
    error = LoadError("f", "w", [1, 2], "numbers")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # it crosses between processes
