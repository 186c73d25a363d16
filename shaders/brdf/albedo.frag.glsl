#version 410 core
// Provides: shares of the directional albedo, the part of light from one direction that is reflected. A column is an
// angle theta_o (midpoints of 0 to 90 degrees), a row a set of directions at an azimuth of its own; the mean over the
// rows is the albedo. By reciprocity light and eye are exchanged.
#include "generated/brdf.glsl"
#include "brdf/sampling.glsl"

uniform vec2 size;  // angles, rows

layout(location = 0) out vec4 share;

const int N_COSINE = 16, N_POLE = 48;

void main() {
    float theta = gl_FragCoord.x / size.x * 1.57079633, row = gl_FragCoord.y - 0.5;
    vec2 turn = fract(vec2(0.5, 0.25) + row * vec2(0.75487767, 0.56984029));
    vec3 wo = polar(cos(theta), sin(theta), TAU * (row + 0.5) / size.y), found = vec3(0.0);
    for (int j = 0; j < N_COSINE + N_POLE; ++j) {
        vec3 wi = j < N_COSINE ? sample_cosine(spread(j, N_COSINE, turn))
                               : sample_pole(spread(j - N_COSINE, N_POLE, turn), wo);
        if (wi.z > 0.0) {
            found += brdf_cosine(wi, wo) / (float(N_COSINE) * cosine_density(wi) + float(N_POLE) * pole_density(wi, wo));
        }
    }
    share = vec4(found, 1.0);
}
