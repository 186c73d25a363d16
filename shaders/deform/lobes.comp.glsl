#version 430 core
// Provides: the radiance of white diffuse points, and their gloss towards the camera: lobes in the points' current
// axes, each a look-up in the light of bands along directions [Sloan05, eq. 25]. As `_shading_kernels`.
layout(local_size_x = 64) in;

#include "deform/light.glsl"
#include "deform/blockers.glsl"
#include "deform/gloss.glsl"

layout(std430, binding = 0) readonly buffer Lobes { float lobes[]; };    // a point: low (4), lobes of axis and bands
layout(std430, binding = 1) readonly buffer Posed { float posed[]; };    // a point: rows of its frame (9), place (3)
layout(std430, binding = 2) readonly buffer Owners { int owners[]; };    // the object of each point
layout(std430, binding = 5) readonly buffer Objects { float objects[]; };  // albedo, first gloss, emission, their count
layout(std430, binding = 7) writeonly buffer Sent { float sent[]; };     // a point: white (3), gloss (3)
uniform int n_points, n_lobes;
uniform int added_light;  // after how many lights what neighbours add begins, −1 for none
uniform vec3 camera_position;

vec3 diffuse(int p, mat3 frame) {
    int at = p * (4 + n_lobes * (3 + ORDER));
    vec3 radiance = light_of_low(vec4(lobes[at], lobes[at + 1], lobes[at + 2], lobes[at + 3]), frame);
    vec3 bands[ORDER];
    at += 4;
    for (int i = 0; i < n_lobes; i++, at += 3 + ORDER) {
        look_up(frame * vec3(lobes[at], lobes[at + 1], lobes[at + 2]), bands);
        for (int l = 0; l < ORDER; l++)
            radiance += lobes[at + 3 + l] * bands[l];
    }
    return max(radiance, 0.0);
}

void main() {
    int p = int(gl_GlobalInvocationID.x);
    if (p >= n_points)
        return;
    mat3 frame;  // its columns are tangent, bitangent, normal
    vec3 place;
    for (int i = 0; i < 3; i++) {
        frame[i] = vec3(posed[12 * p + 3 * i], posed[12 * p + 3 * i + 1], posed[12 * p + 3 * i + 2]);
        place[i] = posed[12 * p + 9 + i];
    }
    int object = 10 * owners[p], own_light = int(objects[object + 8]);
    choose_light(own_light);
    vec3 white = diffuse(p, frame), to_camera = vec3(0.0), wo = camera_position - place;
    choose_light(0);
    white = with_shadows(white, owners[p], place, frame[2]);
    if (added_light >= 0) {
        choose_light(added_light);
        white += light_at(p);
    }
    choose_light(own_light);
    int first = int(objects[object + 3]), count = int(objects[object + 7]);
    for (int layer = first; layer < first + count; layer++)
        to_camera += shiny(layer, frame[2], wo / max(length(wo), 1e-30), white, objects[object + 9]);
    for (int i = 0; i < 3; i++) {
        sent[6 * p + i] = white[i];
        sent[6 * p + 3 + i] = to_camera[i];
    }
}
