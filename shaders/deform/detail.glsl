// Provides: the radiance of a white diffuse pixel whose lobes lie on texture coordinates, as
// `engine.realtime.zonal_harmonics.surface_details`.
#include "deform/light.glsl"

layout(std430, binding = 0) readonly buffer Map { float map_lobes[]; };  // an entry: low (4), lobes of axis and bands
uniform int map_first, n_lobes;
uniform ivec2 map_shape;  // rows, columns
uniform vec2 repeats;     // of a smooth map: along which coordinate its rows lie, and how often
uniform bool is_smooth;   // lobes lie between entries, else they are the nearest one's

int entry(ivec2 place) {
    return map_first + (place.x * map_shape.y + place.y) * (4 + n_lobes * (3 + ORDER));
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

vec3 of_entries(ivec4 around, vec2 share, ivec2 ends, float between, mat3 frame) {
    vec4 low;
    for (int k = 0; k < 4; k++) {
        float upper = mix(map_lobes[around.x + k], map_lobes[around.y + k], share.y);
        low[k] = mix(upper, mix(map_lobes[around.z + k], map_lobes[around.w + k], share.y), share.x);
    }
    vec3 radiance = light_of_low(low, frame), bands[ORDER];
    float lobe[3 + ORDER];
    for (int i = 0; i < n_lobes; i++) {
        ivec2 first = ends + 4 + i * (3 + ORDER);
        for (int k = 0; k < 3 + ORDER; k++)
            lobe[k] = mix(map_lobes[first.x + k], map_lobes[first.y + k], between);
        look_up(frame * unit(vec3(lobe[0], lobe[1], lobe[2]), vec3(0.0, 0.0, 1.0)), bands);
        for (int l = 0; l < ORDER; l++)
            radiance += lobe[3 + l] * bands[l];
    }
    return max(radiance, 0.0);
}

vec3 white_of_detail(vec2 uv, mat3 axes, bool is_front) {
    mat3 frame = frame_of(axes, is_front);
    if (is_smooth) {
        float row = fract(dot(uv, repeats)) * float(map_shape.x - 1);
        int top = min(int(row), map_shape.x - 2);
        ivec2 ends = ivec2(entry(ivec2(top, 0)), entry(ivec2(top + 1, 0)));
        return of_entries(ends.xxyy, vec2(row - float(top), 0.0), ends, row - float(top), frame);
    }
    vec2 place = vec2(1.0 - fract(uv.y * repeats.y), fract(uv.x * repeats.x)) * vec2(map_shape) - 0.5;
    ivec2 first = ivec2(floor(place));
    vec2 share = place - vec2(first);
    ivec2 near = (first + ivec2(step(0.5, share)) + map_shape) % map_shape;
    ivec2 low = (first + map_shape) % map_shape, high = (first + 1) % map_shape;
    ivec4 around = ivec4(entry(low), entry(ivec2(low.x, high.y)), entry(ivec2(high.x, low.y)), entry(high));
    return of_entries(around, share, ivec2(entry(near)), 0.0, frame);
}
