#version 410 core
// Provides: the lit sphere for the screen, tone mapped and sRGB encoded, transparent around, its rim smoothed.
#include "common/tone_mapping.glsl"

uniform sampler2D summed;
uniform float side;

layout(location = 0) out vec4 colour;

void main() {
    vec4 sum = texelFetch(summed, ivec2(gl_FragCoord.xy), 0);
    float inside = 0.5 * side * (1.0 / 1.02 - length(gl_FragCoord.xy / side * 2.0 - 1.0));  // texels from the rim
    colour = vec4(display_colour(sum.rgb / max(sum.w, 1.0)), clamp(inside + 0.5, 0.0, 1.0));
}
