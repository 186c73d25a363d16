// Provides: by what a layer's texture and weight multiply it at a pixel, as `LayerMaps.factor`.
#include "common/images.glsl"
#include "common/strokes.glsl"
uniform int tint, weight;  // where images begin, −1 for none
uniform vec2 tint_repeats;
uniform float tint_strength, weight_start;
uniform bool inverts, has_vertex_colours;

// The pixel's sides are `right` and `below` in texture coordinates; place and normal are the mesh's as it is painted.
vec3 factor(vec2 uv, vec2 right, vec2 below, vec3 place, vec3 normal, vec3 colour) {
    vec3 texel = tint < 0 ? vec3(1.0) : over_pixel(tint, uv, right, below, tint_repeats);
    if (has_vertex_colours)
        texel *= colour;
    float share = weight < 0 ? weight_start : over_pixel(weight, uv, right, below, vec2(1.0)).x;
    share = painted(share, place, normal);
    return (1.0 + tint_strength * (texel - 1.0)) * (inverts ? 1.0 - share : share);
}
