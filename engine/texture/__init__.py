"""Image textures and weight maps: read, filtered, sampled where the eye looks.

    file ─► images.read_texture ─► Pyramid (means at halved sizes) ─► render.surface_maps: one factor a pixel, filtered
    over what the pixel sees of the image; one mean over the whole surface, for further bounces; plain look-ups for
    traced paths ─► render.canvas: what strokes of a brush make of a weight map, at the same points

`store.TextureStore` keeps a scene's images; `engine.material.layer_maps` says which a layer has. Worker and stills
only.
"""
