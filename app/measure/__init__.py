"""`insitu measure`: what speed costs in accuracy on a scene, measured against brute force.

    scene ─► settings_placement, settings_orbit, settings_deform ─► settings ─► settings.csv, front.json
                                                                              └► settings_report ─► report.md, plots

`settings_study` runs all of it. `subject`, `precomputed` and `accuracy` serve `benchmarks/` as well, which measures the
project itself. `front` writes the table behind the slider between speed and accuracy.
"""
