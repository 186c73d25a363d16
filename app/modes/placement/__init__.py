"""Placement: curves and light are edited under a fixed camera [BenArtzi07].

`transport_controller` requests transport, `contraction_controller` parts of it, `indirect_controller` further bounces,
`band_plans` the bands of curves, `map_controller` images; `comparison` follows side A. `desired_state` and
`desired_freezing` have the values that they compare, `curves` the band values of the document's curves,
`placement_events` what the renderer receives.
"""
