// Provides: triangles between shading points as the eye sees them, picture row 0 below, and their points on its side.

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 face;
layout(location = 2) in vec2 image_place;
layout(location = 3) in ivec2 sides;
layout(location = 4) in vec3 first_way;
layout(location = 5) in vec3 second_way;
uniform vec3 eye;
uniform mat3 towards;  // right and up, so that the picture's edges are at −1 and 1, and forward
uniform vec2 depth;    // of clip space, z = x · distance + y

invariant gl_Position;

bool is_back() {
    return dot(face, position - eye) > 0.0;
}

void place() {
    vec3 at = towards * (position - eye);
    gl_Position = vec4(at.xy, depth.x * at.z + depth.y, at.z);
}
