#version 410 core
// Provides: the linear picture. A pixel that sees a reflecting surface has the address of its shaded radiance, others
// have -1 and show the backdrop. At edges it has -2 - i, and shows the backdrop and several surfaces: from the i-th texel
// of `mixed` on stand their addresses and, as bits, their shares of the pixel, of which the last is negative.
// Alpha is the backdrop's, and 1 where a surface fills the pixel. What is not finite becomes black.
#include "common/finite.glsl"
#include "common/sample_layout.glsl"

uniform isampler2D pixel_addresses;
uniform isampler2D mixed;
uniform sampler2D shaded;
uniform sampler2D backdrop;

layout(location = 0) out vec4 radiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int address = texelFetch(pixel_addresses, pixel, 0).r;
    vec3 surface = texelFetch(shaded, texel_of_address(max(address, 0)), 0).rgb;
    vec4 behind = texelFetch(backdrop, pixel, 0);
    vec3 value = address >= 0 ? surface : behind.rgb;
    if (address < -1) {
        float share = 1.0;
        for (int i = -2 - address; share > 0.0; ++i) {
            ivec2 part = texelFetch(mixed, texel_of_address(i), 0).rg;
            share = intBitsToFloat(part.g);
            value += abs(share) * texelFetch(shaded, texel_of_address(part.r), 0).rgb;
        }
    }
    radiance = vec4(is_finite(value) ? value : vec3(0.0), address >= 0 ? 1.0 : behind.a);
}
