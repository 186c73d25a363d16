"""Numbers that identify angles and models in compiled kernels.

They are separate from the kernels so that the window's process can use them without importing numba, and plain integers
because numba turns these into constants.
"""

# The angle of a curve, [BenArtzi07, ch. 3]; all angles in radians.
THETA_I = 0  # wi and normal
THETA_R = 1  # mirror direction of wi, and wo
THETA_H = 2  # half vector and normal
THETA_D = 3  # wi and half vector
GAMMA_ALPHA = 4  # eq. 3.7: arccos of cos(theta_h) ** cos(phi_h)^2
GAMMA_BETA = 5  # eq. 3.8: arccos of cos(theta_h) ** sin(phi_h)^2
GAMMA_RATIO = 6  # eq. 3.15: arccos of cos(theta_h) ** (n sin(phi_h)^2)
THETA_O = 7  # wo and normal
SLOPE_U = 8  # arctan |h_x| / h_z: the half vector's slope along the tangent
SLOPE_V = 9  # arctan |h_y| / h_z: across
PHI_H = 10  # azimuth of the half vector from the tangent, folded into [0, pi/2]; pi/4 where it is the normal
GAMMA_WIDTH = 11  # 3.3.2: arccos of cos(theta_h) ** (cos(phi_h)^2 + r sin(phi_h)^2)
PHI_D = 12  # azimuth of wi about the half vector from the plane of both and the normal, folded into [0, pi/2]
STREAK = 13  # arctan of the half vector's slope, where that along the tangent counts as alpha_b / alpha_t of it

# Angles of the half vector: a curve over one of them is a highlight. Those of HALF_AZIMUTHS make it anisotropic.
HALF_AZIMUTHS = (GAMMA_ALPHA, GAMMA_BETA, GAMMA_RATIO, SLOPE_U, SLOPE_V, PHI_H, GAMMA_WIDTH, STREAK)
HALF_ANGLES = (THETA_H, *HALF_AZIMUTHS)

# Models whose quotient is in `_kernels`, because most pictures need it to be fast.
LAMBERT = 0
PHONG = 1
BLINN_PHONG = 2
COOK_TORRANCE = 3
ROUGH_CONDUCTOR = 4
ASHIKHMIN_SHIRLEY = 5
ASHIKHMIN_SHIRLEY_RATIO = 6
# Any other model has its quotient in its own file; kernels identify it by the address of its compiled form.
OWN = -1

# Indices of the eight quotient parameters, by model; for any model the last marks a layer's second Fresnel term, and
# the one before is the number of its frame. No kernel reads that: it decides which frames they get.
N_QUOTIENT_PARAMETERS = 8
FRAME, FRESNEL_TERM = 6, 7
ROUGH_DISTRIBUTION = 0  # rough_conductor: GGX or BECKMANN
ROUGH_ALPHA = 1
FACING_REFLECTANCE = 0  # blinn_phong and both Ashikhmin-Shirley models
# Ashikhmin-Shirley models with one curve: exponent n of the ratio, ratio r of the width. Below 0 its size is
# meant, and tangent and bitangent change places.
RATIO_EXPONENT = 1
# brushed: the widths of its highlight along the tangent and across, alpha_t and alpha_b.
ALPHA_ALONG, ALPHA_ACROSS = 0, 1
# Measured models: the table and the smoothing of its curves, or, in the process that computes, their addresses; then
# the colour that is looked up, or MEAN of all; the part; and whether the table is of an anisotropic surface.
TABLE, SMOOTHING, CHANNEL, PART, ADAPTIVE = 0, 1, 2, 3, 4

GGX = 0
BECKMANN = 1
MEAN = 3
# Parts of a measurement: diffuse, the highlight by the curves that it has, and the whole.
DIFFUSE = 0
SPECULAR = 1
WHOLE = 2
AROUND = 3
TWIST = 4
BRUSHED = 5

# Cosines to the normal at or below this reflect nothing: the least for which 1/cosine is a sane number.
GRAZING = 1e-12
