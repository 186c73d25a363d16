"""Placement: curves and light are edited under a camera that rests [BenArtzi07].

`transport_talk` asks the worker for transport and `indirect_talk` for light of further bounces, `band_plans` for the
bands of curves and `map_talk` for images; `comparison` keeps side A. `wishes` are the values they compare, `curves`
what the document's curves come to, `events` what the renderer is told of it all.
"""
