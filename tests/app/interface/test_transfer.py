"""The change of a curve for other layers, in Python."""

import pytest

import insitu


def test_layers_get_the_change_of_a_curve() -> None:
    scene = insitu.open("teatray", resolution=(32, 32))
    lacquer, handles = scene["tray"]["lacquer"], scene["handles"]
    lacquer["theta_h"].amplify(y=2.0, region=(0.0, 0.0, 0.2, 0.4))
    (name,) = [name for name in handles if "theta_h" in list(handles[name])]
    before = handles[name]["theta_h"]([0.05])
    lacquer["theta_h"].transfer(handles[name])
    assert handles[name]["theta_h"]([0.05]) == pytest.approx(2.0 * before, rel=1e-2)
    scene.undo()
    assert handles[name]["theta_h"]([0.05]) == pytest.approx(before)
    with pytest.raises(insitu.Error, match="no curve theta_h"):
        lacquer["theta_h"].transfer(scene["tray"]["base"])
