"""What Orbit and Deform share. Their transfer models, `triple_product` and `zonal_harmonics`, plug in and do not know
each other.

    shading_points     where light is computed, and the triangles between these points
    lit_sides          which sides of objects light can reach
    view_samples       what each pixel shows, by rays: the points around it, texture coordinates, factors of maps
    raster             the same by rasterized triangles, where all corners move in every picture
    terms              which layers are diffuse or isotropic, and the factor of a layer's maps at pixels
    gpu_parts          the data of moving pictures in the layout of GPU buffers
"""
