"""Image textures and weight maps: reading, filtering and sampling.

    file ─► texture_files.read_texture ─► Pyramid (means at halved sizes) ─► scene.map_sampler: one factor a pixel,
    filtered over its footprint; one mean over the whole surface, for further bounces; plain look-ups for traced paths
    ─► scene.map_sampler.Canvas: brush strokes on a weight map, at the same points

`texture_store.TextureStore` caches a scene's images; `engine.material.layer_maps` describes those of a layer. Worker
and stills only.
"""
