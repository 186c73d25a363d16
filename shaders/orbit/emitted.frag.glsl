#version 430 core
// Provides: the emission of an object's front, and depth.

flat in int shows_back;
uniform vec3 emission;

layout(location = 0) out vec4 radiance;

void main() {
    radiance = vec4(shows_back == 0 ? emission : vec3(0.0), 1.0);
}
