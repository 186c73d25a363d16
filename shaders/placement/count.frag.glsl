#version 410 core
// Provides: a fragment for each pixel of the linear picture that was not finite; a samples-passed query counts them.

uniform sampler2D linear_picture;

layout(location = 0) out vec4 mark;

void main() {
    if (texelFetch(linear_picture, ivec2(gl_FragCoord.xy), 0).a > 0.5) discard;
    mark = vec4(1.0);
}
