#version 410 core
// Provides: anti-aliased silhouettes: a pixel's display colour mixed with that of the surface beside it. Mixed after
// tone mapping, so that an edge against a bright light stays smooth.
#include "common/tone_mapping.glsl"

uniform sampler2D linear_picture;
uniform float exposure;  // a factor

flat in ivec2 own_pixel;
flat in ivec2 other_pixel;
flat in float other_weight;

layout(location = 0) out vec4 colour;

void main() {
    vec3 own = display_colour(exposure * texelFetch(linear_picture, own_pixel, 0).rgb);
    vec3 other = display_colour(exposure * texelFetch(linear_picture, other_pixel, 0).rgb);
    colour = vec4(mix(own, other, other_weight), 1.0);
}
