#version 410 core
// Provides: the picture for the screen, exposed, tone mapped and encoded, over its background: one colour, a
// checkerboard, or none, for files with alpha. INSPECTED: with one channel alone, and stripes where it is clipped.
#include "common/tone_mapping.glsl"

uniform sampler2D linear_picture;  // alpha: the share of a pixel that is covered, multiplied into the light
uniform ivec2 first;               // the texel of the picture that the target's first shows
uniform vec2 stride;               // texels of the picture for each of the target
uniform float exposure;            // a factor
uniform vec3 behind;               // radiance of the background, exposed
uniform int transparent;           // 0: over one colour; 1: over a checkerboard; 2: not over anything
uniform float inverse_gamma;       // the exponent of the finished colours

const int SQUARE = 8;  // pixels
const vec3 DARK = vec3(0.30), LIGHT = vec3(0.36);

layout(location = 0) out vec4 colour;

#if INSPECTED
uniform int channel;  // 0: all; 1, 2, 3: red, green or blue; 4: alpha; 5: luminance
uniform bool zebra;   // stripes where a channel is at the upper end of the screen's values

const int STRIPE = 4;  // pixels
const float CLIPPED = 254.5 / 255.0;
const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

vec3 chosen(vec3 radiance) {
    if (channel == 0) return radiance;
    return vec3(channel == 5 ? dot(radiance, LUMINANCE) : radiance[min(channel, 3) - 1]);
}

vec3 marked(vec3 shown, ivec2 texel) {
    bool is_clipped = max(shown.r, max(shown.g, shown.b)) >= CLIPPED;
    return zebra && is_clipped && ((texel.x + texel.y) / STRIPE & 1) == 0 ? vec3(0.08) : shown;
}
#else
vec3 chosen(vec3 radiance) { return radiance; }
vec3 marked(vec3 shown, ivec2 texel) { return shown; }
#endif

vec3 on_screen(vec3 radiance) {
    vec3 shown = display_colour(chosen(radiance));
    return inverse_gamma == 1.0 ? shown : pow(shown, vec3(inverse_gamma));
}

void main() {
    ivec2 texel = first + ivec2(stride * gl_FragCoord.xy);
    vec4 radiance = texelFetch(linear_picture, texel, 0);
#if INSPECTED
    if (channel == 4) {
        colour = vec4(vec3(radiance.a), 1.0);
        return;
    }
#endif
    if (transparent == 0) {
        colour = vec4(marked(on_screen(exposure * radiance.rgb + (1.0 - radiance.a) * behind), texel), 1.0);
        return;
    }
    // The colour of what covers the pixel, which does not depend on how much of it is covered.
    vec3 own = radiance.a > 0.0 ? marked(on_screen(exposure * radiance.rgb / radiance.a), texel) : vec3(0.0);
    ivec2 square = texel / SQUARE;
    vec3 board = ((square.x + square.y) & 1) == 0 ? LIGHT : DARK;
    colour = transparent == 2 ? vec4(own, radiance.a) : vec4(mix(board, own, radiance.a), 1.0);
}
