#version 430 core
// Provides: corners of the triangles that one layer lies on by texture coordinates, see
// `engine.realtime.core.gpu_parts.CoverPart`.
#include "deform/corner.glsl"
#include "common/vertex_colour.glsl"

layout(std430, binding = 2) readonly buffer Axes { float surface_axes[]; };  // along u, along v, outwards

in ivec4 corner;        // its place, the point on its front and its back, -1 for none, and its axes
in vec4 image_places;
in vec3 position, face;
in ivec2 packed_colour;

centroid out vec3 front_white, back_white;
out vec4 uvs;  // in two sets of texture coordinates
out vec3 at;
flat out vec3 outside;
flat out ivec2 has_points;
#if HAS_MAPS
centroid out vec3 vertex_colour;
#endif
#if HAS_HOLES
sample out vec4 opacity_uvs;
sample out float vertex_opacity;
#endif
#if HAS_DETAIL
centroid out mat3 axes;
centroid out vec3 here;
#endif

void main() {
    place(corner.x);
    front_white = sent_by(corner.y, 0);
    back_white = sent_by(corner.z, 0);
    uvs = image_places;
    at = position;
    outside = face;
#if HAS_MAPS
    vertex_colour = unpacked_colour(packed_colour).rgb;
#endif
#if HAS_HOLES
    opacity_uvs = image_places;
    vertex_opacity = unpacked_colour(packed_colour).a;
#endif
    has_points = ivec2(corner.y >= 0, corner.z >= 0);
#if HAS_DETAIL
    for (int i = 0; i < 9; i++)
        axes[i / 3][i % 3] = surface_axes[9 * corner.w + i];
    here = vec3(posed[12 * corner.x + 9], posed[12 * corner.x + 10], posed[12 * corner.x + 11]);
#endif
}
