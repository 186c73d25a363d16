#version 410 core
// Provides: the picture for the screen, exposed, tone mapped and sRGB encoded, over its background: one colour, a
// checkerboard, or none, for files with alpha.
#include "common/tone_mapping.glsl"

uniform sampler2D linear_picture;  // alpha: the share of a pixel that is covered, multiplied into the light
uniform float exposure;            // a factor
uniform vec3 behind;               // radiance of the background, exposed
uniform int transparent;           // 0: over one colour; 1: over a checkerboard; 2: not over anything

const int SQUARE = 8;  // pixels
const vec3 DARK = vec3(0.30), LIGHT = vec3(0.36);

layout(location = 0) out vec4 colour;

void main() {
    vec4 radiance = texelFetch(linear_picture, ivec2(gl_FragCoord.xy), 0);
    if (transparent == 0) {
        colour = vec4(display_colour(exposure * radiance.rgb + (1.0 - radiance.a) * behind), 1.0);
        return;
    }
    // The colour of what covers the pixel, which does not depend on how much of it is covered.
    vec3 own = radiance.a > 0.0 ? display_colour(exposure * radiance.rgb / radiance.a) : vec3(0.0);
    ivec2 square = ivec2(gl_FragCoord.xy) / SQUARE;
    vec3 board = ((square.x + square.y) & 1) == 0 ? LIGHT : DARK;
    colour = transparent == 2 ? vec4(own, radiance.a) : vec4(mix(board, own, radiance.a), 1.0);
}
