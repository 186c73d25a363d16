#version 410 core
// Provides: the slice of a BRDF for the screen, sRGB encoded as pictures of measured BRDFs are: diffuse is grey, what is
// above 1 is white.
#include "common/srgb.glsl"

uniform sampler2D values;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(encode_srgb(clamp(texelFetch(values, ivec2(gl_FragCoord.xy), 0).rgb, 0.0, 1.0)), 1.0);
}
