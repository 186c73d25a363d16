"""Light after more than one bounce, for editing in final placement [BenArtzi07, ch. 5 and 6].

A pixel needs to know which places of the scene it sees, and how bright they are:

- *gather points* (`gather`): some of the picture's points, each with a fan of rays; a ray keeps the number of the
  surface cell it hits. Which curve the point reflects them with is not known yet.
- *cells* (`cells`): patches of surface of the same facing, with irradiance from the light and from one another.
- `irradiance`: the bounces between cells, as a polynomial in the edited object's equivalent albedo.
- `reflection`: what the gather points reflect of it, by band of the edited curve or with the curve as it is.

The bands of a pixel times all monomials of the albedos of M objects would be a tensor that grows as M^N; the fan and
the cells hold the same sums in memory that does not depend on M.
"""
