// Provides: the projection of a triangle's corner to the picture, and the radiance of the points there.
#include "common/view.glsl"

layout(std430, binding = 1) readonly buffer Posed { float posed[]; };  // a point: rows of its frame (9), place (3)
layout(std430, binding = 7) readonly buffer Sent { float sent[]; };    // a point: white (3), gloss (3)

vec3 placed(int p) {
    int at = 12 * p + 9;
    return vec3(posed[at], posed[at + 1], posed[at + 2]);
}

void place(int p) {
    gl_Position = projected(placed(p));
}

vec3 sent_by(int p, int first) {
    return p < 0 ? vec3(0.0) : vec3(sent[6 * p + first], sent[6 * p + first + 1], sent[6 * p + first + 2]);
}
