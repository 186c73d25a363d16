#version 410 core
// Provides: radiance of a sphere of the material before the eye, under a key light from the upper left, a rim light from
// behind on the right, and a dome that is brighter above; added to what was drawn before with other directions. w counts
// what has been added. Orthographic, y up; texture row 0 is the top of the picture.
#include "generated/brdf.glsl"
#include "brdf/sampling.glsl"

uniform float side;  // texels of the picture, whose middle is the sphere's
uniform vec2 turn;   // of the set of directions

layout(location = 0) out vec4 sum;

const int N_KEY = 6, N_RIM = 4, N_DOME = 10, N_POLE = 16;
const vec3 KEY = vec3(-0.4915, 0.5695, 0.6590), RIM = vec3(0.7913, 0.4352, -0.4292);
const float KEY_WIDTH = 70.0, RIM_WIDTH = 40.0;           // k of `blob_density`
const vec3 KEY_POWER = vec3(2.5, 2.45, 2.35), RIM_POWER = vec3(1.3, 1.4, 1.6);  // irradiance when faced

vec3 dome(float up) {
    vec3 above = mix(vec3(0.42, 0.43, 0.45), vec3(0.62, 0.66, 0.72), clamp(up, 0.0, 1.0));
    return mix(vec3(0.10, 0.095, 0.09), above, smoothstep(-0.25, 0.25, up));
}

void main() {
    vec2 place = (gl_FragCoord.xy / side * 2.0 - 1.0) * vec2(1.0, -1.0) * 1.02;
    float r2 = dot(place, place);
    if (r2 > 1.02 * 1.02) {
        sum = vec4(0.0, 0.0, 0.0, 1.0);
        return;
    }
    place *= min(1.0, 0.985 * inversesqrt(r2));  // at the rim itself a texel sees whatever its corner happens to meet
    vec3 n = vec3(place, sqrt(1.0 - dot(place, place)));
    vec3 t = normalize(vec3(n.z, 0.0, -n.x)), b = cross(n, t);  // docs/conventions.md, "The local frame"
    mat3 to_local = transpose(mat3(t, b, n));
    vec3 wo = to_local * vec3(0.0, 0.0, 1.0), key = to_local * KEY, rim = to_local * RIM;
    vec3 up = to_local * vec3(0.0, 1.0, 0.0);
    vec3 found = vec3(0.0);
    for (int j = 0; j < N_KEY + N_RIM + N_DOME + N_POLE; ++j) {
        vec3 wi;
        float about = -1.0;  // density about the pole, where it is known
        if (j < N_KEY) {
            wi = sample_blob(spread(j, N_KEY, turn), key, KEY_WIDTH);
        } else if (j < N_KEY + N_RIM) {
            wi = sample_blob(spread(j - N_KEY, N_RIM, turn), rim, RIM_WIDTH);
        } else if (j < N_KEY + N_RIM + N_DOME) {
            wi = sample_cosine(spread(j - N_KEY - N_RIM, N_DOME, turn));
        } else {
            wi = sample_pole(spread(j - N_KEY - N_RIM - N_DOME, N_POLE, turn), wo, about);
        }
        if (wi.z <= 0.0) {
            continue;
        }
        float key_density = blob_density(wi, key, KEY_WIDTH), rim_density = blob_density(wi, rim, RIM_WIDTH);
        float density = float(N_KEY) * key_density + float(N_RIM) * rim_density
            + float(N_DOME) * cosine_density(wi) + float(N_POLE) * (about < 0.0 ? pole_density(wi, wo) : about);
        vec3 light = KEY_POWER * key_density + RIM_POWER * rim_density + dome(dot(wi, up));
        found += brdf_cosine(wi, wo) * light / density;
    }
    sum = vec4(min(found, vec3(1e4)), 1.0);
}
