"""A small OpenColorIO configuration for tests, with tables of one and of three dimensions, a look, and two displays."""

from pathlib import Path

import numpy as np

_HEAD = """ocio_profile_version: 2
search_path: luts
strictparsing: true
roles: {{default: raw, scene_linear: lin{role}}}
file_rules:
  - !<Rule> {{name: Default, colorspace: default}}
displays:
  Monitor:
    - !<View> {{name: Plain, colorspace: srgb}}
    - !<View> {{name: Film, colorspace: film}}
  Projector:
    - !<View> {{name: Plain, colorspace: gamma}}
    - !<View> {{name: Cube, colorspace: cube}}
looks:
  - !<Look>
    name: Warm
    process_space: lin
    transform: !<CDLTransform> {{slope: [2, 1, 0.5]}}
colorspaces:
  - !<ColorSpace> {{name: raw, isdata: true}}
  - !<ColorSpace>
    name: lin
{linear}
  - !<ColorSpace>
    name: srgb
    from_scene_reference: !<GroupTransform>
      children:
{to_lin}        - !<ExponentWithLinearTransform> {{gamma: 2.4, offset: 0.055, direction: inverse}}
  - !<ColorSpace>
    name: film
    from_scene_reference: !<GroupTransform>
      children:
{to_lin}        - !<MatrixTransform> {{matrix: [0.25, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1]}}
        - !<FileTransform> {{src: curve.spi1d, interpolation: linear}}
  - !<ColorSpace>
    name: gamma
    from_scene_reference: !<GroupTransform>
      children:
{to_lin}        - !<ExponentTransform> {{value: [2.2, 2.2, 2.2, 1], direction: inverse}}
  - !<ColorSpace>
    name: cube
    from_scene_reference: !<GroupTransform>
      children:
{to_lin}        - !<ExponentTransform> {{value: [2.2, 2.2, 2.2, 1], direction: inverse}}
        - !<FileTransform> {{src: colours.cube, interpolation: tetrahedral}}
"""
# From ACES2065-1 to linear Rec. 709, by Bradford's adaptation, to six digits.
_AP0 = (2.521686, -1.134131, -0.387555, -0.276480, 1.372719, -0.096239, -0.015378, -0.152975, 1.168353)


def write_config(folder: Path, interchange: bool = False) -> Path:
    """The configuration in a folder. interchange: its reference is ACES2065-1, and it says so; else it is its
    scene_linear."""
    (folder / "luts").mkdir()
    steps = np.linspace(0.0, 1.0, 257)
    lines = [f"{value:.7f}" for value in steps**2 * (3.0 - 2.0 * steps)]  # a curve with a toe and a shoulder
    head = "Version 1\nFrom 0.0 1.0\nLength 257\nComponents 1\n{\n"
    (folder / "luts" / "curve.spi1d").write_text(head + "\n".join(lines) + "\n}\n")
    axis = np.linspace(0.0, 1.0, 9)
    rows = [f"{g:.6f} {r * r:.6f} {0.5 * (b + r):.6f}" for b in axis for g in axis for r in axis]  # red fastest
    (folder / "luts" / "colours.cube").write_text("LUT_3D_SIZE 9\n" + "\n".join(rows) + "\n")
    a, b, c, d, e, f, g, h, i = _AP0
    matrix = f"matrix: [{a}, {b}, {c}, 0, {d}, {e}, {f}, 0, {g}, {h}, {i}, 0, 0, 0, 0, 1]"
    to_lin = f"        - !<MatrixTransform> {{{matrix}}}\n" if interchange else ""
    linear = f"    from_scene_reference: !<MatrixTransform> {{{matrix}}}" if interchange else "    family: scene"
    if interchange:
        linear += "\n  - !<ColorSpace> {name: aces}"
    role = ", aces_interchange: aces" if interchange else ""
    path = folder / "small.ocio"
    path.write_text(_HEAD.format(role=role, linear=linear, to_lin=to_lin))
    return path
