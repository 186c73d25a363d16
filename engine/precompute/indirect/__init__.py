"""Light after more than one bounce, for editing in final placement [BenArtzi07, ch. 5 and 6].

A pixel depends on the surfaces it sees indirectly, and on their radiosity:

- *gather points* (`gather`): some of the picture's points, with hemisphere samples each; a sample stores the index of
  the record it hits. The curve with which the point reflects it is applied later.
- *irradiance cache records* (`irradiance_cache`): patches of surface of the same orientation, with irradiance from the
  lights and from one another.
  Between them light bounces, as a polynomial in the edited object's equivalent albedo.
- `reflection`: the reflection of this light at the gather points, by band of the edited curve or with all curves
  applied.

The bands of a pixel times all monomials of the albedos of M objects would form a tensor that grows as M^N. Hemisphere
samples and records hold the same sums in memory that does not depend on M.
"""
