#version 430 core
// Provides: the emission of an object's front, times its texture, and depth.
#include "common/cone.glsl"
#include "common/images.glsl"
#if HAS_HOLES
#include "common/opacity.glsl"
uniform int i_object;
#endif
#if HAS_MAPS
#include "common/maps.glsl"
in vec4 uvs;
centroid in vec3 vertex_colour;
#endif

flat in int shows_back;
in vec3 from_camera;
uniform vec3 emission;
uniform vec4 cone;  // into which it is sent

layout(location = 0) out vec4 radiance;

void main() {
#if HAS_MAPS
    vec4 right = dFdx(uvs), below = dFdy(uvs);
#endif
#if HAS_HOLES
    if (is_hole(i_object))
        discard;
#endif
    vec3 shines = shows_back == 0 ? emission * cone_share(cone, from_camera) : vec3(0.0);
#if HAS_MAPS
    shines *= factor(uvs, right, below, vec3(0.0), vec3(0.0), vertex_colour);  // no strokes, which need a place
#endif
    radiance = vec4(shines, 1.0);
}
