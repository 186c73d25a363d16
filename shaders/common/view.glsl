// Provides: where the eye sees a place, in clip space, picture row 0 below (ui/gl/view_target.py, `seen_from`).

uniform vec3 eye;
uniform mat3 towards;  // right and up, so that the picture's edges are at −1 and 1, and forward
uniform vec2 depth;    // of clip space, z = x · distance + y

invariant gl_Position;

vec4 seen_at(vec3 place) {
    vec3 at = towards * (place - eye);
    return vec4(at.xy, depth.x * at.z + depth.y, at.z);
}
