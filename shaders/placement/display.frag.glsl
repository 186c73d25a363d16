#version 410 core
// Provides: the picture for the screen, exposed, tone mapped and sRGB encoded.
#include "common/tone_mapping.glsl"

uniform sampler2D linear_picture;
uniform float exposure;  // a factor

layout(location = 0) out vec4 colour;

void main() {
    vec3 radiance = texelFetch(linear_picture, ivec2(gl_FragCoord.xy), 0).rgb;
    colour = vec4(display_colour(exposure * radiance), 1.0);
}
