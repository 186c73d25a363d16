#version 410 core
// Provides: the linear picture: Orbit's, enlarged to the picture's size where it has fewer pixels, and over it so much
// of another of that size as `share` says, alpha as well. What is not finite becomes black.
#include "common/finite.glsl"

uniform sampler2D picture;
uniform sampler2D other;
uniform vec2 size;  // of the target
uniform float share;  // of the other, 0 to 1

layout(location = 0) out vec4 radiance;

void main() {
    vec4 value = texture(picture, gl_FragCoord.xy / size);
    if (share > 0.0) {
        value = mix(value, texelFetch(other, ivec2(gl_FragCoord.xy), 0), share);
    }
    radiance = vec4(is_finite(value.rgb) ? value.rgb : vec3(0.0), value.a);
}
