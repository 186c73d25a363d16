// Provides: distant light in bands, as `engine.realtime.zonal_harmonics.shading.BandLight`.

const int ORDER = 6;  // `engine.realtime.zonal_harmonics.object_transfer.ORDER`

// Of the sky and of each object that has other light: harmonics, then the table; then what neighbours add to points.
layout(std430, binding = 3) readonly buffer Light { float light[]; };
uniform ivec2 table;  // rows, columns
int light_first = 0;  // of the light that is meant

const float PI = 3.14159265358979;

void choose_light(int k) {
    light_first = k * ORDER * (ORDER + table.x * table.y);
}

vec3 light_at(int i) {
    int at = 3 * (light_first + i);
    return vec3(light[at], light[at + 1], light[at + 2]);
}

// The light of each band along a direction, interpolated between four entries; rows beyond a pole continue opposite.
void look_up(vec3 d, out vec3 bands[ORDER]) {
    float row = acos(clamp(d.z, -1.0, 1.0)) * (table.x / PI) - 0.5;
    float column = (atan(d.y, d.x) + PI) * (table.y / (2.0 * PI)) - 0.5;
    ivec2 first = ivec2(floor(row), floor(column));
    vec2 share = vec2(row, column) - vec2(first);
    for (int l = 0; l < ORDER; l++)
        bands[l] = vec3(0.0);
    for (int k = 0; k < 4; k++) {
        ivec2 step = ivec2(k / 2, k % 2), at = first + step;
        if (at.x < 0 || at.x >= table.x)
            at = ivec2(clamp(at.x, 0, table.x - 1), at.y + table.y / 2);
        at.y = (at.y + table.y) % table.y;
        vec2 near = mix(1.0 - share, share, vec2(step));
        int entry = ORDER * ORDER + (at.x * table.y + at.y) * ORDER;
        for (int l = 0; l < ORDER; l++)
            bands[l] += near.x * near.y * light_at(entry + l);
    }
}

// The radiance by the exact bands 0 and 1, in axes that are the columns of frame.
vec3 light_of_low(vec4 low, mat3 frame) {
    vec3 linear = frame * vec3(-low.w, -low.y, low.z);
    return low.x * light_at(0) - linear.y * light_at(1) + linear.z * light_at(2) - linear.x * light_at(3);
}
