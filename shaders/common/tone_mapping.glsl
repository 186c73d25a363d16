// Provides: display_colour(radiance), the sRGB-encoded colour in [0, 1] of a linear Rec. 709 radiance that is exposed
// already. One of TONE_LINEAR, TONE_FILMIC, TONE_TABLE, TONE_FALSE_COLOUR, TONE_CONFIGURED is defined to 1.
#include "common/srgb.glsl"
#include "common/viridis.glsl"

#if TONE_FILMIC
// Narkowicz' fit of the ACES reference rendering (K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2016).
// The brightest and the darkest channel go by it, the middle one stays where it is between them, as in the tone curve of
// Adobe's DNG SDK: the hue is kept. Channel by channel orange would turn to yellow, and gold to olive.
float filmic(float x) {
    return clamp((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
}

vec3 tone_map(vec3 radiance) {
    vec3 x = min(max(radiance, vec3(0.0)), vec3(1e4));
    float high = max(x.r, max(x.g, x.b)), low = min(x.r, min(x.g, x.b));
    float bottom = filmic(low);
    return bottom + (filmic(high) - bottom) * (x - low) / max(high - low, 1e-20);
}
#elif TONE_LINEAR
vec3 tone_map(vec3 radiance) {
    return clamp(radiance, 0.0, 1.0);
}
#endif

#if TONE_FALSE_COLOUR
// log2 of luminance in bands of one stop, from -8 to +8. The lower half of each stop is a little darker, so that stops
// can be counted.
vec3 display_colour(vec3 radiance) {
    float luminance = dot(max(radiance, vec3(0.0)), vec3(0.2126, 0.7152, 0.0722));
    float stops = clamp(log2(max(luminance, 1e-12)), -8.0, 8.0);
    return viridis((stops + 8.0) / 16.0) * (fract(stops) < 0.5 ? 0.85 : 1.0);
}
#elif TONE_TABLE
// A view as a table of display colours over log2 of the channels (engine/core/colour.py).
uniform sampler3D view_table;
uniform vec2 table_stops;  // log2 of radiance in the first and the last texel

vec3 display_colour(vec3 radiance) {
    vec3 stops = clamp(log2(max(radiance, vec3(1e-30))), table_stops.x, table_stops.y);
    float side = float(textureSize(view_table, 0).x);
    vec3 place = (stops - table_stops.x) / (table_stops.y - table_stops.x);
    return clamp(texture(view_table, (place * (side - 1.0) + 0.5) / side).rgb, 0.0, 1.0);
}
#elif TONE_CONFIGURED
// A view of a configuration of OpenColorIO, whose text replaces this file (engine/core/colour_config.py).
#include "common/configured_view.glsl"

vec3 display_colour(vec3 radiance) {
    vec3 shown = configured_view(vec4(min(max(radiance, vec3(0.0)), vec3(65536.0)), 1.0)).rgb;
    return clamp(shown, 0.0, 1.0);
}
#else
vec3 display_colour(vec3 radiance) {
    return encode_srgb(tone_map(radiance));
}
#endif
