#version 430 core
// Provides: corners of triangles where they are now, and what the points there send on either side.
layout(std430, binding = 1) readonly buffer Posed { float posed[]; };
layout(std430, binding = 6) readonly buffer Sent { float sent[]; };
uniform vec3 eye;
uniform mat3 towards;   // a direction to column and row, -1 to 1 times depth, and depth
uniform vec2 depth;

in ivec4 corner;        // its place, the point on its front and its back, -1 for none, and the object

centroid out vec3 front_white, front_gloss, back_white, back_gloss;
flat out ivec3 shown;   // whether there are points on front and back, and the object

vec3 sent_by(int p, int first) {
    return p < 0 ? vec3(0.0) : vec3(sent[6 * p + first], sent[6 * p + first + 1], sent[6 * p + first + 2]);
}

void main() {
    int at = 12 * corner.x + 9;
    vec3 seen = towards * (vec3(posed[at], posed[at + 1], posed[at + 2]) - eye);
    gl_Position = vec4(seen.xy, depth.x * seen.z + depth.y, seen.z);
    front_white = sent_by(corner.y, 0);
    front_gloss = sent_by(corner.y, 3);
    back_white = sent_by(corner.z, 0);
    back_gloss = sent_by(corner.z, 3);
    shown = ivec3(corner.y >= 0, corner.z >= 0, corner.w);
}
