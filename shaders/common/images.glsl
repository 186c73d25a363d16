// Provides: look-ups in the scene's images over a pixel, as `Pyramid.over` with is_quick.

layout(std430, binding = 5) readonly buffer ImageWords { uint image_words[]; };

const int N_HEAD = 49;  // words: how many levels, height, width and first texel of 16 of them
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

vec3 between_texels(int image, ivec3 level, vec2 uv) {
    vec2 size = vec2(level.yx), place = vec2(fract(uv.x), 1.0 - fract(uv.y)) * size - 0.5;
    ivec2 n = level.yx, low = ivec2(floor(place));
    vec2 share = place - vec2(low);
    low = (low + n) % n;
    ivec2 high = (low + 1) % n;
    vec3 upper = mix(texel_at(image, level, low.x, low.y), texel_at(image, level, high.x, low.y), share.x);
    vec3 lower = mix(texel_at(image, level, low.x, high.y), texel_at(image, level, high.x, high.y), share.x);
    return mix(upper, lower, share.y);
}

// The mean over a pixel whose sides are `right` and `below` in texture coordinates, all of them times repeats.
vec3 over_pixel(int image, vec2 uv, vec2 right, vec2 below, vec2 repeats) {
    ivec3 finest = level_of(image, 0);
    vec2 size = vec2(finest.yx), times = repeats * size;
    vec2 a = clamp(right * times, -LONGEST, LONGEST), b = clamp(below * times, -LONGEST, LONGEST);
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
        total += between_texels(image, level, repeats * uv + ((float(i) + 0.5) / float(n) - 0.5) * step);
    }
    return total / float(n);
}
