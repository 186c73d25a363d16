// Provides: the radiance of a white diffuse pixel whose lobes lie on texture coordinates, and its normal, as
// `engine.realtime.zonal_harmonics.surface_details`.
// Needs common/images.glsl.
#include "deform/light.glsl"

// An entry: normal (3), low (4), lobes of axis and bands.
layout(std430, binding = 0) readonly buffer Map { float map_lobes[]; };
uniform int map_first, n_lobes;
uniform ivec2 map_shape;  // rows, columns
uniform vec2 repeats;     // of a smooth map: along which coordinate its rows lie, and how often
uniform bool is_smooth;   // lobes lie between entries, else they are the nearest one's
uniform float map_depth;  // of a smooth map: where along its columns, 0 to 1
uniform int depth_image;  // that says so instead, −1 for none

const int LOW = 3, LOBES = 7;

int entry(ivec2 place) {
    return map_first + (place.x * map_shape.y + place.y) * (LOBES + n_lobes * (3 + ORDER));
}

vec3 unit(vec3 v, vec3 instead) {
    float size = length(v);
    return size > 1e-12 ? v / size : instead;
}

// Along u, along v, outwards on the visible side.
mat3 frame_of(mat3 mean, bool is_front) {
    vec3 normal = unit(mean[2], vec3(0.0, 0.0, 1.0));
    vec3 other = abs(normal.x) < 0.5 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    vec3 along = unit(mean[0] - dot(mean[0], normal) * normal, unit(cross(normal, other), other));
    float handed = determinant(mean) < 0.0 ? -1.0 : 1.0;
    return mat3(along, handed * cross(normal, along), is_front ? normal : -normal);
}

// A number of four entries, the first two above the others; share: of those on the right, and below.
float mixed(ivec4 around, vec2 share, int k) {
    float upper = mix(map_lobes[around.x + k], map_lobes[around.y + k], share.x);
    return mix(upper, mix(map_lobes[around.z + k], map_lobes[around.w + k], share.x), share.y);
}

// The entries around a place of the map (row, column), and the shares of those on the right, and below.
ivec4 entries_around(vec2 place, out vec2 share) {
    ivec2 first = ivec2(floor(place)), low = (first + map_shape) % map_shape, high = (first + 1) % map_shape;
    if (is_smooth) {
        low = clamp(first, ivec2(0), map_shape - 2);
        high = low + 1;
        first = low;
    }
    share = (place - vec2(first)).yx;
    return ivec4(entry(low), entry(ivec2(low.x, high.y)), entry(ivec2(high.x, low.y)), entry(high));
}

// The place of texture coordinates in the map (row, column).
vec2 map_place(vec2 uv) {
    if (!is_smooth)
        return vec2(1.0 - fract(uv.y * repeats.y), fract(uv.x * repeats.x)) * vec2(map_shape) - 0.5;
    float deep = depth_image < 0 ? map_depth : between_texels(depth_image, level_of(depth_image, 0), uv).x;
    return vec2(fract(dot(uv, repeats)), clamp(deep, 0.0, 1.0)) * vec2(map_shape - 1);
}

// The normal of the detail: frame has columns along u, along v, outwards.
vec3 detail_normal(vec2 uv, mat3 frame) {
    vec2 share;
    ivec4 around = entries_around(map_place(uv), share);
    return frame * unit(vec3(mixed(around, share, 0), mixed(around, share, 1), mixed(around, share, 2)), vec3(0, 0, 1));
}

vec3 white_of_detail(vec2 uv, mat3 frame) {
    vec2 share;
    ivec4 around = entries_around(map_place(uv), share);
    vec4 low;
    for (int k = 0; k < 4; k++)
        low[k] = mixed(around, share, LOW + k);
    if (!is_smooth) {  // lobes of neighbours do not correspond
        vec2 near = step(0.5, share);
        around = ivec4(near.y > 0.0 ? (near.x > 0.0 ? around.w : around.z) : (near.x > 0.0 ? around.y : around.x));
        share = vec2(0.0);
    }
    vec3 radiance = light_of_low(low, frame), bands[ORDER];
    for (int i = 0; i < n_lobes; i++) {
        int first = LOBES + i * (3 + ORDER);
        vec3 axis = vec3(mixed(around, share, first), mixed(around, share, first + 1), mixed(around, share, first + 2));
        look_up(frame * unit(axis, vec3(0.0, 0.0, 1.0)), bands);
        for (int l = 0; l < ORDER; l++)
            radiance += mixed(around, share, first + 3 + l) * bands[l];
    }
    return max(radiance, 0.0);
}
