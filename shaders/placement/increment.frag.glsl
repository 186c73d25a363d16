#version 410 core
// Provides: sum over k of delta_k * T_k for eight samples at once, lane j into target j [BenArtzi07, ch. 7].
// The transport of one coefficient is one layer: its samples' red, green, blue one after the other, so a group of eight
// samples is 24 numbers, three texels of eight halves (HALF) or six texels of four floats.
#include "common/half_float.glsl"

const int MAX_TERMS = 128;

#if HALF
uniform usampler2DArray transport;
#else
uniform sampler2DArray transport;
#endif
uniform int n_terms;
uniform vec4 terms[MAX_TERMS];  // rgb: what to multiply the stored numbers with, a: the layer

layout(location = 0) out vec4 sample_0;
layout(location = 1) out vec4 sample_1;
layout(location = 2) out vec4 sample_2;
layout(location = 3) out vec4 sample_3;
layout(location = 4) out vec4 sample_4;
layout(location = 5) out vec4 sample_5;
layout(location = 6) out vec4 sample_6;
layout(location = 7) out vec4 sample_7;

// The 24 numbers of a group in memory order. No arrays: software rasterizers keep those in memory.
#if HALF
void fetch_group(ivec2 group, int layer, out vec4 n0, out vec4 n1, out vec4 n2, out vec4 n3, out vec4 n4, out vec4 n5) {
    uvec4 words_0 = texelFetch(transport, ivec3(3 * group.x, group.y, layer), 0);
    uvec4 words_1 = texelFetch(transport, ivec3(3 * group.x + 1, group.y, layer), 0);
    uvec4 words_2 = texelFetch(transport, ivec3(3 * group.x + 2, group.y, layer), 0);
    vec4 low_0 = low_halves(words_0), high_0 = high_halves(words_0);
    vec4 low_1 = low_halves(words_1), high_1 = high_halves(words_1);
    vec4 low_2 = low_halves(words_2), high_2 = high_halves(words_2);
    n0 = vec4(low_0.x, high_0.x, low_0.y, high_0.y);
    n1 = vec4(low_0.z, high_0.z, low_0.w, high_0.w);
    n2 = vec4(low_1.x, high_1.x, low_1.y, high_1.y);
    n3 = vec4(low_1.z, high_1.z, low_1.w, high_1.w);
    n4 = vec4(low_2.x, high_2.x, low_2.y, high_2.y);
    n5 = vec4(low_2.z, high_2.z, low_2.w, high_2.w);
}
#else
void fetch_group(ivec2 group, int layer, out vec4 n0, out vec4 n1, out vec4 n2, out vec4 n3, out vec4 n4, out vec4 n5) {
    n0 = texelFetch(transport, ivec3(6 * group.x, group.y, layer), 0);
    n1 = texelFetch(transport, ivec3(6 * group.x + 1, group.y, layer), 0);
    n2 = texelFetch(transport, ivec3(6 * group.x + 2, group.y, layer), 0);
    n3 = texelFetch(transport, ivec3(6 * group.x + 3, group.y, layer), 0);
    n4 = texelFetch(transport, ivec3(6 * group.x + 4, group.y, layer), 0);
    n5 = texelFetch(transport, ivec3(6 * group.x + 5, group.y, layer), 0);
}
#endif

void main() {
    ivec2 group = ivec2(gl_FragCoord.xy);
    vec3 s0 = vec3(0.0), s1 = vec3(0.0), s2 = vec3(0.0), s3 = vec3(0.0);
    vec3 s4 = vec3(0.0), s5 = vec3(0.0), s6 = vec3(0.0), s7 = vec3(0.0);
    for (int i = 0; i < n_terms; ++i) {
        vec3 delta = terms[i].rgb;
        vec4 n0, n1, n2, n3, n4, n5;
        fetch_group(group, int(terms[i].a), n0, n1, n2, n3, n4, n5);
        s0 += delta * n0.xyz;
        s1 += delta * vec3(n0.w, n1.xy);
        s2 += delta * vec3(n1.zw, n2.x);
        s3 += delta * n2.yzw;
        s4 += delta * n3.xyz;
        s5 += delta * vec3(n3.w, n4.xy);
        s6 += delta * vec3(n4.zw, n5.x);
        s7 += delta * n5.yzw;
    }
    sample_0 = vec4(s0, 0.0);
    sample_1 = vec4(s1, 0.0);
    sample_2 = vec4(s2, 0.0);
    sample_3 = vec4(s3, 0.0);
    sample_4 = vec4(s4, 0.0);
    sample_5 = vec4(s5, 0.0);
    sample_6 = vec4(s6, 0.0);
    sample_7 = vec4(s7, 0.0);
}
