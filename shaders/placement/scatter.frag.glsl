#version 410 core
// Provides: one lane of the increments, copied into its columns of an accumulator (blending adds).

uniform sampler2D increments;
uniform int first_column;

layout(location = 0) out vec4 radiance;

void main() {
    radiance = texelFetch(increments, ivec2(gl_FragCoord.xy) - ivec2(first_column, 0), 0);
}
