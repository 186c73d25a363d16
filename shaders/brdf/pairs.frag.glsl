#version 410 core
// Provides: the BRDF (1/sr) of pairs of directions in the local frame, one pair a texel.
#include "generated/brdf.glsl"

uniform sampler2D towards_light;
uniform sampler2D towards_eye;

layout(location = 0) out vec4 value;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    value = vec4(brdf(texelFetch(towards_light, texel, 0).xyz, texelFetch(towards_eye, texel, 0).xyz), 1.0);
}
