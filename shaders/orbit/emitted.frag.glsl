#version 430 core
// Provides: what an object emits, by its front; depth beside it.

flat in int shows_back;
uniform vec3 emission;

layout(location = 0) out vec4 radiance;

void main() {
    radiance = vec4(shows_back == 0 ? emission : vec3(0.0), 1.0);
}
