// Provides: by what a layer's texture and weight multiply it at a pixel, as `LayerMaps.factor`.
#include "common/images.glsl"
#include "common/strokes.glsl"
uniform int tint, other_tint, weight;  // where images begin, −1 for none
uniform vec2 tint_repeats, other_tint_repeats;
uniform float tint_strength, weight_start;
uniform bool inverts, has_vertex_colours;

// The pixel's sides are `right` and `below` in both sets of texture coordinates; place and normal are the mesh's as it
// is painted.
vec3 factor(vec4 uvs, vec4 right, vec4 below, vec3 place, vec3 normal, vec3 colour) {
    vec3 texel = tint < 0 ? vec3(1.0) : over_pixel(tint, uvs, right, below, tint_repeats);
    if (other_tint >= 0)
        texel *= over_pixel(other_tint, uvs, right, below, other_tint_repeats);
    if (has_vertex_colours)
        texel *= colour;
    float share = weight < 0 ? weight_start : over_pixel(weight, uvs, right, below, vec2(1.0)).x;
    share = painted(share, place, normal);
    return (1.0 + tint_strength * (texel - 1.0)) * (inverts ? 1.0 - share : share);
}
