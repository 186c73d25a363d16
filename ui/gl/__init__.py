"""All OpenGL calls of Insitu: 4.1 core, fragment shaders only, but for Orbit's moving pictures on a graphics card.

What flows where in Placement, from the worker's arrays to the screen::

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

``context`` opens OpenGL, ``program`` reads shaders, ``textures`` and ``buffers`` allocate, ``passes`` draws,
``tonemap`` shows; a ``picture_frame`` is the camera's view. In ``placement``, ``sample_layout`` says where a sample
lies; ``coefficients`` keeps the books without GL, ``transport`` and ``accumulate`` hold and add the terms, ``refine``
joins the three; ``layers`` and ``composite`` make the picture, and ``renderer`` is what the window talks to.

Orbit's pictures come from the worker to the ``canvas`` in ``orbit``. On a graphics card with OpenGL 4.3 (``choice``)
moving ones are drawn here: ``point_buffers`` holds what the worker tells of the shading points, ``shaded_picture``
reflects it towards the eye in a compute shader and draws the triangles between them.

Apart from the picture, a material is seen by its BRDF in GLSL: ``python_to_glsl`` translates the models' own functions,
``brdf_source`` joins them to layers, a ``brdf_stack`` has a material's curves and numbers and draws brdf/*.frag.glsl.

All pictures have row 0 at the top and are stored so: texture row 0 is the picture's top row.
"""
