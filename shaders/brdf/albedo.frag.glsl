#version 410 core
// Provides: shares of the directional albedo, the part of light from one direction that is reflected. A column is an
// angle theta_o (midpoints of 0 to 90 degrees), a row a part of one even set of directions, at an azimuth of its own; the
// mean over the rows is the albedo. By reciprocity light and eye are exchanged.
#include "generated/brdf.glsl"
#include "brdf/sampling.glsl"

uniform vec2 size;  // angles, rows

layout(location = 0) out vec4 share;

const int N_COSINE = 20, N_POLE = 52;

void main() {
    float theta = gl_FragCoord.x / size.x * 1.57079633;
    int row = int(gl_FragCoord.y), n_rows = int(size.y);
    // The set turns with the eye: seen from it, all rows are one even set for a material that is the same all around.
    float azimuth = fract((float(row) + 0.5) * GOLDEN);
    vec3 wo = polar(cos(theta), sin(theta), TAU * azimuth), found = vec3(0.0);
    for (int j = 0; j < N_COSINE + N_POLE; ++j) {
        bool about_pole = j >= N_COSINE;
        int n = about_pole ? N_POLE : N_COSINE, place = (about_pole ? j - N_COSINE : j) * n_rows + row;
        vec2 u = spread(place, n * n_rows, vec2(0.5, 0.25 + azimuth));
        float about;
        vec3 wi = about_pole ? sample_pole(u, wo, about) : sample_cosine(u);
        about = about_pole ? about : pole_density(wi, wo);
        if (wi.z > 0.0) {
            found += brdf_cosine(wi, wo) / (float(N_COSINE) * cosine_density(wi) + float(N_POLE) * about);
        }
    }
    share = vec4(found, 1.0);
}
