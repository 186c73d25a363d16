#version 430 core
// Provides: corners of triangles at their current places, and the radiance of the points there on either side.
#include "deform/corner.glsl"

in ivec4 corner;        // its place, the point on its front and its back, -1 for none, and the object

centroid out vec3 front_white, front_gloss, back_white, back_gloss;
#if HAS_HOLES
layout(std430, binding = 13) readonly buffer Holes { float holes[]; };  // of each corner: two sets of texture coordinates, opacity
sample out vec4 opacity_uvs;
sample out float vertex_opacity;
#endif
out vec3 from_camera;
flat out ivec3 shown;   // whether there are points on front and back, and the object

void main() {
    place(corner.x);
    from_camera = placed(corner.x) - camera_position;
    front_white = sent_by(corner.y, 0);
    front_gloss = sent_by(corner.y, 3);
    back_white = sent_by(corner.z, 0);
    back_gloss = sent_by(corner.z, 3);
#if HAS_HOLES
    int first = 5 * gl_VertexID;
    opacity_uvs = vec4(holes[first], holes[first + 1], holes[first + 2], holes[first + 3]);
    vertex_opacity = holes[first + 4];
#endif
    shown = ivec3(corner.y >= 0, corner.z >= 0, corner.w);
}
