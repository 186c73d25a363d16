"""The text of a scene of one ground under an even sky, which many tests put in a file."""


def ground(
    resolution: tuple[int, int], radiance: str = "[0.4, 0.5, 0.7]", gloss: bool = False, bounces: int = 1
) -> str:
    """A matt ground of 18 m, and a second layer of gloss on it where that is asked for."""
    layers = '{ model = "lambert" }' + (', { model = "rough_conductor" }' if gloss else "")
    return f"""version = 1
bounces = {bounces}
[camera]
position = [0.4, 1.6, 2.6]
target = [0, 0.3, 0]
fov_y = 45
resolution = {list(resolution)}
[environment]
radiance = {radiance}
[[object]]
name = "ground"
primitive = "quad"
transform = [9,0,0,0, 0,0,9,0, 0,-9,0,0, 0,0,0,1]
layer = [{layers}]
"""
