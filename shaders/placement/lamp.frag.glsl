#version 410 core
// Provides: a rectangle, a disc or a ball that shines, to be drawn over the picture: the share of each pixel that it
// covers in front of the surface at the pixel's centre, as alpha, and its radiance times that. What faces away is black.
// BALL, DISC: its shape; else a square. In its own frame it is 1 wide, about 0, and shines to +Z.

uniform sampler2D distances;  // of the surfaces at the pixels' centres, along the rays
uniform vec3 eye;             // the camera, in the lamp's frame
uniform mat3 plane;           // the picture's, in the lamp's frame: upper left corner, one pixel to the right, down
uniform mat3 world_plane;     // the same in the world
uniform vec3 emission;
uniform vec4 cone;            // of a spot, in the world: a row of `engine.light.cones`

const int SIDE = 4;  // samples of a pixel along each side
const float NEAR = 1.0001;

layout(location = 0) out vec4 radiance;

// Where a ray meets the lamp, in lengths of `way`; -1 where it does not.
float place_on_ray(vec3 way, out bool is_front) {
#if BALL
    float a = dot(way, way), b = dot(eye, way), c = dot(eye, eye) - 0.25, root = b * b - a * c;
    if (root < 0.0) return -1.0;
    is_front = c > 0.0;
    return (-b + (is_front ? -1.0 : 1.0) * sqrt(root)) / a;
#else
    is_front = eye.z > 0.0;
    float place = -eye.z / way.z;
    vec2 met = eye.xy + place * way.xy;
#if DISC
    return dot(met, met) <= 0.25 ? place : -1.0;
#else
    return max(abs(met.x), abs(met.y)) <= 0.5 ? place : -1.0;
#endif
#endif
}

void main() {
    float limit = NEAR * texelFetch(distances, ivec2(gl_FragCoord.xy), 0).r;
    vec2 first = floor(gl_FragCoord.xy);
    radiance = vec4(0.0);
    for (int i = 0; i < SIDE * SIDE; ++i) {
        vec3 at = vec3(1.0, first + (vec2(i % SIDE, i / SIDE) + 0.5) / float(SIDE));
        vec3 way = world_plane * at;
        bool is_front = false;
        float place = place_on_ray(plane * at, is_front), far = length(way);
        if (!(place > 0.0 && place * far < limit)) continue;
        float along = clamp(cone.w - dot(cone.xyz, way) / far, 0.0, 1.0);
        radiance += vec4(is_front ? along * along * emission : vec3(0.0), 1.0);
    }
    radiance /= float(SIDE * SIDE);
}
