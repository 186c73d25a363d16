// Provides: triangles between shading points as the camera sees them, and their points on its side.
#include "common/view.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 face;
layout(location = 2) in vec4 image_places;  // in two sets of texture coordinates
layout(location = 3) in ivec2 sides;
layout(location = 4) in vec3 first_way;
layout(location = 5) in vec3 second_way;
layout(location = 6) in ivec2 packed_colour;

bool is_back() {
    return dot(face, position - camera_position) > 0.0;
}
