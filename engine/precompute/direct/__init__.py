"""Transport of direct light [BenArtzi07, ch. 4]: lights and their visibility projected onto the bands of curves, stored
in planes of coefficients, and lit anew under another sky.
"""
