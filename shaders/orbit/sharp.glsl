// Provides: sharp gloss, reflected pixel by pixel, as `engine.realtime.triple_product.pixel_reflection`,
// `reflect_at_pixels`: by the coefficients of the three points around the pixel, and by peaks one by one.
#include "orbit/points.glsl"
#include "orbit/slices.glsl"
#if HAS_FORMULA
#include "generated/brdf.glsl"
#endif

layout(std430, binding = 7) readonly buffer Corners { int corners[]; };  // 20 words each
layout(std430, binding = 12) readonly buffer Peaks { vec4 peaks[]; };  // direction and power of each
flat in int shows_back, triangle;
centroid in vec3 shares;  // of the triangle's corners
uniform vec3 camera_position;
uniform int n_most;   // coefficients
uniform int first_peak, n_peaks;  // of those that reach the object

const float LEAST_COSINE = 1e-3;

// What a point reflects of its coefficients, and without a formula of its peaks, so that the mirror shows `mirrored`.
vec3 point_gloss(int p, vec3 mirrored) {
    vec3 local = vec3(dot(tangent_of(p), mirrored), dot(normal_of(p), mirrored), dot(across_of(p), mirrored));
    Cell cell = cell_at(vec3(-local.x, local.y, -local.z));
    int first = row_of(p) * row_words, n = min(int(rows[first]), n_most);
    vec3 total = vec3(0.0);
    for (int k = 0; k < n; ++k) {
        total += reflected_coefficient(cell, first, k);
    }
#if !HAS_FORMULA
    for (int s = 0; s < N_PEAKS; ++s) {
        total += reflected_peak(cell, first, s);
    }
#endif
    return total;
}

#if HAS_FORMULA
// What the layers' formulas reflect of the peaks that the points see, in a frame of tangent, normal and across.
vec3 peak_gloss(ivec3 p, mat3 frame, vec3 wo) {
    vec3 seen_from = wo * frame;
    seen_from.y = max(seen_from.y, LEAST_COSINE);
    seen_from = normalize(vec3(seen_from.x, -seen_from.z, seen_from.y));
    vec3 total = vec3(0.0);
    for (int word = 0; 32 * word < n_peaks; ++word) {
        uvec3 seen;
        for (int k = 0; k < 3; ++k) {
            seen[k] = rows[row_of(p[k]) * row_words + FIRST_BITS + word];
        }
        for (uint left = seen.x | seen.y | seen.z; left != 0u; left &= left - 1u) {
            int bit = findLSB(left), s = 32 * word + bit;
            vec3 d = peaks[2 * (first_peak + s)].xyz * frame;
            if (d.y > 0.0) {
                float share = dot(shares, vec3((seen >> uint(bit)) & 1u));
                total += share * peaks[2 * (first_peak + s) + 1].rgb * brdf_cosine(vec3(d.x, -d.z, d.y), seen_from);
            }
        }
    }
    return total;
}
#endif

// The points around the pixel on the side that shows, -1 for none.
ivec3 points_around() {
    ivec3 p;
    for (int k = 0; k < 3; ++k) {
        p[k] = corners[20 * (3 * triangle + k) + 10 + shows_back];
    }
    return p;
}

// The tangent of a point, or its opposite, which means the same to all materials: the one that leans along `beside`.
vec3 tangent_along(int p, vec3 beside) {
    return dot(tangent_of(p), beside) < 0.0 ? -tangent_of(p) : tangent_of(p);
}

// Radiance towards the camera; offset: of the unit normal, perpendicular to it.
vec3 sharp_gloss(vec3 place, vec3 offset) {
    ivec3 p = points_around();
    if (p.x < 0 || p.y < 0 || p.z < 0) {
        return vec3(0.0);
    }
    vec3 wo = normalize(camera_position - place);
    vec3 normal = mat3(normal_of(p.x), normal_of(p.y), normal_of(p.z)) * shares;
    vec3 first = tangent_of(p.x);
    vec3 tangent = mat3(first, tangent_along(p.y, first), tangent_along(p.z, first)) * shares;
    normal = normalize(normalize(normal) + offset);
    tangent = normalize(tangent - dot(tangent, normal) * normal);
    vec3 mirrored = 2.0 * dot(normal, wo) * normal - wo;
    vec3 sent = vec3(0.0);
    for (int k = 0; k < 3; ++k) {
        sent += shares[k] * point_gloss(p[k], mirrored);
    }
#if HAS_FORMULA
    sent += peak_gloss(p, mat3(tangent, normal, cross(tangent, normal)), wo);
#endif
    return sent;
}
