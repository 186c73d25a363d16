// Provides: look-ups in the scene's images over a pixel, as `Pyramid.over` with is_quick.

layout(std430, binding = 5) readonly buffer ImageWords { uint image_words[]; };

// Words: how many levels, height, width and first texel of 16 of them, cosine and sine of a turn, an offset, wraps
// and the set of texture coordinates.
const int N_HEAD = 54;
const int TURN = 49;
const uint N_WRAPS = 3u;  // repeat, mirror, clamp
const int MOST_PROBES = 2;
const float LONGEST = 1e6;

vec3 texel_at(int image, ivec3 level, int x, int y) {
    int i = image + N_HEAD + 2 * (level.z + y * level.y + x);
    return vec3(unpackHalf2x16(image_words[i]), unpackHalf2x16(image_words[i + 1]).x);
}

ivec3 level_of(int image, int i) {
    int first = image + 1 + 3 * i;
    return ivec3(image_words[first], image_words[first + 1], image_words[first + 2]);
}

float within(float coordinate, uint wrap) {
    if (wrap == 2u) return clamp(coordinate, 0.0, 1.0);
    if (wrap == 1u) return 1.0 - abs(2.0 * fract(0.5 * coordinate) - 1.0);
    return fract(coordinate);
}

int texel_index(int i, int n, uint wrap) { return wrap == 0u ? (i + n) % n : clamp(i, 0, n - 1); }

vec2 turned(int image, vec2 uv) {
    float cosine = uintBitsToFloat(image_words[image + TURN]), sine = uintBitsToFloat(image_words[image + TURN + 1]);
    return vec2(cosine * uv.x - sine * uv.y, sine * uv.x + cosine * uv.y);
}

vec3 between_texels(int image, ivec3 level, vec2 uv) {
    uint wraps = image_words[image + TURN + 4], along_u = wraps % N_WRAPS, along_v = wraps / N_WRAPS % N_WRAPS;
    vec2 size = vec2(level.yx), place = vec2(within(uv.x, along_u), 1.0 - within(uv.y, along_v)) * size - 0.5;
    ivec2 first = ivec2(floor(place));
    vec2 share = place - vec2(first);
    ivec2 low = ivec2(texel_index(first.x, level.y, along_u), texel_index(first.y, level.x, along_v));
    ivec2 high = ivec2(texel_index(first.x + 1, level.y, along_u), texel_index(first.y + 1, level.x, along_v));
    vec3 upper = mix(texel_at(image, level, low.x, low.y), texel_at(image, level, high.x, low.y), share.x);
    vec3 lower = mix(texel_at(image, level, low.x, high.y), texel_at(image, level, high.x, high.y), share.x);
    return mix(upper, lower, share.y);
}

// Of two sets of texture coordinates those that the image is mapped by.
vec2 in_own_set(int image, vec4 uvs) {
    return image_words[image + TURN + 4] < N_WRAPS * N_WRAPS ? uvs.xy : uvs.zw;
}

// Texture coordinates, times repeats, turned and moved as the image is.
vec2 place_on(int image, vec4 uvs, vec2 repeats) {
    vec2 offset = vec2(uintBitsToFloat(image_words[image + TURN + 2]), uintBitsToFloat(image_words[image + TURN + 3]));
    return turned(image, repeats * in_own_set(image, uvs)) + offset;
}

// The mean over a pixel whose sides are `right` and `below` in texture coordinates, all of them times repeats, and turned
// and moved as the image is.
vec3 over_pixel(int image, vec4 uvs, vec4 right, vec4 below, vec2 repeats) {
    ivec3 finest = level_of(image, 0);
    vec2 size = vec2(finest.yx);
    vec2 a = clamp(turned(image, in_own_set(image, right) * repeats) * size, -LONGEST, LONGEST);
    vec2 b = clamp(turned(image, in_own_set(image, below) * repeats) * size, -LONGEST, LONGEST);
    vec2 middle = place_on(image, uvs, repeats);
    float xx = a.x * a.x + b.x * b.x, yy = a.y * a.y + b.y * b.y, xy = a.x * a.y + b.x * b.y;
    float spread = sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
    float longer = sqrt(max(0.5 * (xx + yy) + spread, 0.0));
    float shorter = abs(a.x * b.y - a.y * b.x) / max(longer, 1e-30);
    int n = clamp(int(ceil(longer / max(shorter, 1.0) - 1e-3)), 1, MOST_PROBES);
    float wide = max(shorter, longer / float(MOST_PROBES));
    int depth = wide > 1.0 ? int(floor(log2(wide) + 0.5)) : 0;
    ivec3 level = level_of(image, min(depth, int(image_words[image]) - 1));
    float twice = spread > 0.0 ? 0.5 * (xx - yy) / spread : 1.0;
    vec2 step = longer * sqrt(max(vec2(0.5 + 0.5 * twice, 0.5 - 0.5 * twice), 0.0)) / size;
    step.y = xy < 0.0 ? -step.y : step.y;
    vec3 total = vec3(0.0);
    for (int i = 0; i < n; ++i) {
        total += between_texels(image, level, middle + ((float(i) + 0.5) / float(n) - 0.5) * step);
    }
    return total / float(n);
}
