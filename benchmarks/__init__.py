"""Measures the project itself, speed against accuracy: `make measure`, which is `python -m benchmarks`.

    scene ─► direct: speed against brute force, pictures against references ─┐
          ─► window: launches, edits on the renderer ────────────────────────┤
          ─► sweep: lights, bands, precision, shadows together ──────────────┼─► figures.json, sweep.csv, plots
    built-in scenes and references ─► api_edit, indirect, edges, rooms, ─────┤
          gloss, orbit, deform, relighting, turning_sky ─────────────────────┘
    scene ─► settings (`app.measure`) and variants ─► settings.csv, front.json, report.md, plots
    shapes, bunny, plant, dominoes ─► visibility_methods ─► visibility.csv, its tables and plot
    teatray, rings, plant ─► visibility_textures ─► visibility_textures.csv
    every scene ─► plan_costs, plan_savings ─► planning.csv, savings.csv

`figures` names what was promised and its limits. Figures are measured in this process, but for `launches`, which starts
the window and the `programs` that draw: nothing else here calls OpenGL. What cannot be measured on a machine (no
OpenGL, no display) stands in the file with the reason, and the rest is measured all the same.

Programs of their own write pages and references: `peers` (docs/peers.md), `large_scenes` (docs/scale.md),
`room_references` (tests/golden/rooms), `point_lights` and `light_groups` (docs/benchmarks.md), `gloss_transfer`
(docs/deform.md), `hand_over` (docs/orbit.md, docs/deform.md), `open_files` and `lights` (docs/measured-changes.md).
"""

PARTS = ("settings", "figures", "visibility", "planning")
