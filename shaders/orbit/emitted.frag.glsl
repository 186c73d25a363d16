#version 430 core
// Provides: the emission of an object's front, and depth.
#include "common/cone.glsl"
#if HAS_HOLES
#include "common/opacity.glsl"
uniform int i_object;
#endif

flat in int shows_back;
in vec3 from_camera;
uniform vec3 emission;
uniform vec4 cone;  // into which it is sent

layout(location = 0) out vec4 radiance;

void main() {
#if HAS_HOLES
    if (is_hole(i_object))
        discard;
#endif
    radiance = vec4(shows_back == 0 ? emission * cone_share(cone, from_camera) : vec3(0.0), 1.0);
}
