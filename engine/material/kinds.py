"""Numbers by which compiled kernels know angles and models.

They stand apart from the kernels so that the window's process can name them without importing numba, and are plain
integers because numba turns them into constants.
"""

# What a curve runs over, [BenArtzi07, ch. 3]; all angles in radians.
THETA_I = 0  # light and normal
THETA_R = 1  # mirrored light and eye
THETA_H = 2  # half vector and normal
THETA_D = 3  # light and half vector
GAMMA_ALPHA = 4  # eq. 3.7: arccos of cos(theta_h) ** cos(phi_h)^2
GAMMA_BETA = 5  # eq. 3.8: arccos of cos(theta_h) ** sin(phi_h)^2
GAMMA_RATIO = 6  # eq. 3.15: arccos of cos(theta_h) ** (n_u sin(phi_h)^2)
THETA_O = 7  # eye and normal
SLOPE_U = 8  # arctan |h_x| / h_z: the half vector's slope along the tangent
SLOPE_V = 9  # arctan |h_y| / h_z: across
PHI_H = 10  # azimuth of the half vector from the tangent, folded into [0, pi/2]; pi/4 where it is the normal

# Angles of the half vector: a curve over one of them is a highlight. Those of HALF_AZIMUTHS make it anisotropic.
HALF_AZIMUTHS = (GAMMA_ALPHA, GAMMA_BETA, GAMMA_RATIO, SLOPE_U, SLOPE_V, PHI_H)
HALF_ANGLES = (THETA_H, *HALF_AZIMUTHS)

# Models whose quotient stands in `_kernels`, where most pictures want it fast.
LAMBERT = 0
PHONG = 1
BLINN_PHONG = 2
COOK_TORRANCE = 3
ROUGH_CONDUCTOR = 4
ASHIKHMIN_SHIRLEY = 5
ASHIKHMIN_SHIRLEY_RATIO = 6
# Any other model has its quotient in its own file; kernels know it by the address of its compiled form.
OWN = -1

# Places of the eight quotient parameters, by model; the last says of any whether it is a layer's second Fresnel term.
N_QUOTIENT_PARAMETERS = 8
FRESNEL_TERM = 7
ROUGH_DISTRIBUTION = 0  # rough_conductor: GGX or BECKMANN
ROUGH_ALPHA = 1
FACING_REFLECTANCE = 0  # blinn_phong and both of Ashikhmin and Shirley
RATIO_EXPONENT = 1  # ashikhmin_shirley_ratio: n_u
# Measured models: which table and how smooth its curves; in the process that computes where both are in memory. Then
# the colour that is looked up, or MEAN of all; and the part.
TABLE, SMOOTHING, CHANNEL, PART = 0, 1, 2, 3

GGX = 0
BECKMANN = 1
MEAN = 3
DIFFUSE = 0
SPECULAR = 1
WHOLE = 2

# Cosines to the normal at or below this reflect nothing: the least for which 1/cosine is a sane number.
GRAZING = 1e-12
