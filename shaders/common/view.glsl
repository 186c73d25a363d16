// Provides: the projection of a place to clip space, picture row 0 below (ui/gl/view_target.py, `view_uniforms`).

uniform vec3 camera_position;
uniform mat3 towards;  // right and up, so that the picture's edges are at −1 and 1, and forward
uniform vec2 depth;    // of clip space, z = x · distance + y

invariant gl_Position;

vec4 projected(vec3 place) {
    vec3 at = towards * (place - camera_position);
    return vec4(at.xy, depth.x * at.z + depth.y, at.z);
}
