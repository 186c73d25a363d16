"""All OpenGL calls of Insitu: 4.1 core, fragment shaders only, except for Orbit's moving pictures on a graphics card.

The data flow of Placement, from the worker's arrays to the screen::

    transport (J,p,3)          c_wanted (J,3)
        │ upload slices             │ CoefficientState picks K terms by |Δc_k|·‖T_k‖
        ▼                           ▼
    TransportTexture ──► increment.frag: Σ_k Δc_k T_k ──► increments (8 lanes)
                                                              │ scatter.frag, blending adds
    radiance (p,3) ─────────── upload ───────────► accumulator, one a layer
                                                              │ shade.frag: f_q·f_o(θ_o), images, footprint; adds
                                                              ▼
    environment, emitters ─► backdrop.frag ─► backdrop    shaded, one row range an object
                                                 │            │
                                                 └─► composite.frag ─► linear picture ─► snapshot for A/B
                                                                              │
                                     silhouettes, outlines (points) ──► display.frag ─► display picture, sRGB

``context`` opens OpenGL, ``program`` reads shaders and draws with them, ``gpu_memory`` allocates textures and buffers,
``display`` shows the picture. In ``ui.modes.placement.gl``, ``transport`` defines where a sample is stored, holds the
terms and adds them; ``refiner`` tracks the shown and the wanted coefficients and moves the one towards the other;
``layers`` and ``composite`` make the picture, and ``renderer`` is the interface to the window.

Orbit's pictures come from the worker to the ``canvas`` in ``ui.modes.orbit.gl``. On a graphics card with OpenGL 4.3
(``context``) moving ones are drawn here: ``shaded_picture`` holds what the worker exports of the shading points,
computes their radiance towards the camera in a compute shader and draws the triangles between them.

Besides the picture, a material is shown by its BRDF in GLSL: ``python_to_glsl`` translates the models' own functions,
a ``brdf_stack`` joins them to layers, has a material's curves and numbers and draws brdf/*.frag.glsl.

All pictures are stored with row 0 at the top: texture row 0 is the picture's top row.
"""
