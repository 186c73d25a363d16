// Provides: the shading points' data (engine/realtime/core/gpu_parts.py): positions and frames, irradiance, and colours
// and marks of the picture that is being drawn.

layout(std430, binding = 0) readonly buffer Points { vec4 points[]; };  // three each
layout(std430, binding = 1) readonly buffer Irradiance { vec4 irradiance[]; };
layout(std430, binding = 2) readonly buffer Indirect { vec4 indirect[]; };

vec3 place_of(int p) { return points[3 * p].xyz; }
int row_of(int p) { return floatBitsToInt(points[3 * p].w); }
vec3 normal_of(int p) { return points[3 * p + 1].xyz; }
vec3 tangent_of(int p) { return points[3 * p + 2].xyz; }
vec3 across_of(int p) { return cross(tangent_of(p), normal_of(p)); }
