#version 430 core
// Provides: the emission of an object's front, and depth.
#if HAS_HOLES
#include "common/opacity.glsl"
uniform int i_object;
#endif

flat in int shows_back;
uniform vec3 emission;

layout(location = 0) out vec4 radiance;

void main() {
#if HAS_HOLES
    if (is_hole(i_object))
        discard;
#endif
    radiance = vec4(shows_back == 0 ? emission : vec3(0.0), 1.0);
}
