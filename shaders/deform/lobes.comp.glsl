#version 430 core
// Provides: the radiance of white diffuse points, and their gloss towards the camera: lobes in the points' current
// axes, each a look-up in the light of bands along directions [Sloan05, eq. 25]. As `_shading_kernels`.
layout(local_size_x = 64) in;

#include "deform/light.glsl"
#include "deform/blockers.glsl"
#include "deform/gloss.glsl"

layout(std430, binding = 0) readonly buffer Lobes { float lobes[]; };    // a point: low (4), lobes of axis and bands; rows
layout(std430, binding = 1) readonly buffer Posed { float posed[]; };    // a point: frame (9), place (3); then of lamps (6)
layout(std430, binding = 2) readonly buffer Owners { ivec2 owners[]; };  // of each point: object, number among its points
layout(std430, binding = 5) readonly buffer Objects { float objects[]; };  // see `AppearancePart.objects`
layout(std430, binding = 7) writeonly buffer Sent { float sent[]; };     // a point: white (3), gloss (3)
uniform int n_points, n_lobes;
uniform int n_row_lobes, first_row_layer, first_views;  // of glossy rows; where in `gloss` their layers and views begin
uniform int added_light;  // after how many lights what neighbours add begins, −1 for none
uniform int n_own_lights;  // of objects; then the parts of these, and of the sky, that gloss mirrors; their skies
uniform int first_of_lamps;  // in `posed`, −1 for none
uniform vec3 camera_position;

const int OBJECT = 16, SIDE = 32;  // numbers of an object; entries along the square of views

// The radiance by `count` lobes from lobes[at] on.
vec3 by_lobes(int at, int count, mat3 frame) {
    vec3 radiance = light_of_low(vec4(lobes[at], lobes[at + 1], lobes[at + 2], lobes[at + 3]), frame);
    vec3 bands[ORDER];
    at += 4;
    for (int i = 0; i < count; i++, at += 3 + ORDER) {
        look_up(frame * vec3(lobes[at], lobes[at + 1], lobes[at + 2]), bands);
        for (int l = 0; l < ORDER; l++)
            radiance += lobes[at + 3 + l] * bands[l];
    }
    return radiance;
}

// As `_gloss_row_kernels.square_place`, in entries.
vec2 square_entry(vec3 d) {
    float radius = sqrt(max(1.0 - d.z, 0.0));
    vec2 place = vec2(0.0);
    if (abs(d.x) > abs(d.y)) {
        float side = d.x > 0.0 ? 1.0 : -1.0;
        place = side * radius * vec2(1.0, atan(side * d.y, side * d.x) * (4.0 / PI));
    } else if (d.y != 0.0) {
        float side = d.y > 0.0 ? 1.0 : -1.0;
        place = side * radius * vec2(atan(side * d.x, side * d.y) * (4.0 / PI), 1.0);
    }
    return clamp((place + 1.0) * (0.5 * SIDE) - 0.5, 0.0, SIDE - 1.0);
}

// What a layer that is drawn by rows sends along wo, in the point's own axes [Sloan05, eq. 16].
vec3 by_rows(int layer, int of_object, mat3 frame, vec3 wo) {
    int at = first_row_layer + 3 * layer, count = int(gloss[at + 1]), views = first_views + int(gloss[at + 2]);
    int row_size = 4 + n_row_lobes * (3 + ORDER);
    int row = n_points * (4 + n_lobes * (3 + ORDER)) + (int(gloss[at]) + of_object * count) * row_size;
    vec2 entry = square_entry(wo);
    ivec2 first = min(ivec2(entry), SIDE - 2);
    vec2 share = entry - vec2(first);
    vec3 total = vec3(0.0);
    for (int k = 0; k < count; k++, row += row_size) {
        vec3 weight = vec3(0.0);
        for (int corner = 0; corner < 4; corner++) {
            ivec2 step = ivec2(corner / 2, corner % 2), place = first + step;
            vec2 near = mix(1.0 - share, share, vec2(step));
            int view = views + 3 * ((place.x * SIDE + place.y) * count + k);
            weight += near.x * near.y * vec3(gloss[view], gloss[view + 1], gloss[view + 2]);
        }
        total += weight * by_lobes(row, n_row_lobes, frame);
    }
    return max(total, 0.0);
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
    int object = OBJECT * owners[p].x, own_light = int(objects[object + 8]);
    choose_light(own_light);
    vec3 own = max(by_lobes(p * (4 + n_lobes * (3 + ORDER)), n_lobes, frame), 0.0);
    vec3 to_camera = vec3(0.0), wo = camera_position - place;
    choose_light(own_light > 0 ? 2 * n_own_lights + 1 + own_light : 0);
    vec3 white = with_shadows(own, owners[p].x, place, frame[2]), left = (white + 1e-20) / (own + 1e-20);
    // Of the light that gloss mirrors, as the point's own transfer has it, and with shadows.
    int mirrored = own_light > 0 ? own_light + n_own_lights : 2 * n_own_lights + 1;
    choose_light(mirrored);
    own = max(by_lobes(p * (4 + n_lobes * (3 + ORDER)), n_lobes, frame), 0.0);
    vec3 reached_white = own * left;
    if (added_light >= 0) {
        choose_light(added_light);
        white += light_at(p);
        reached_white += light_at(p);
    }
    choose_light(mirrored);
    int first = int(objects[object + 3]), count = int(objects[object + 7]);
    for (int layer = first; layer < first + count; layer++)
        to_camera += shiny(layer, frame[2], wo / max(length(wo), 1e-30), reached_white, objects[object + 9]);
    // Rows have the object's own shadows, and take from the others' the share of light that these leave.
    vec3 local = transpose(frame) * wo / max(length(wo), 1e-30);
    float even = objects[object + 9];
    float reached = (dot(reached_white, vec3(1.0)) + even) / max(dot(own, vec3(1.0)) + even, 1e-20);
    first = int(objects[object + 10]), count = int(objects[object + 11]);
    for (int layer = first; layer < first + count && local.z > 0.0; layer++)
        to_camera += min(reached, 1.0) * by_rows(layer, owners[p].y, frame, local);
    for (int i = 0; i < 3 && first_of_lamps >= 0; i++) {
        white[i] += posed[first_of_lamps + 6 * p + i];
        to_camera[i] += posed[first_of_lamps + 6 * p + 3 + i];
    }
    for (int i = 0; i < 3; i++) {
        sent[6 * p + i] = white[i];
        sent[6 * p + 3 + i] = to_camera[i];
    }
}
