// Provides: configured_view(colour), a view of OpenColorIO. Programs that have one are made with its text in this place.

vec4 configured_view(vec4 colour) { return colour; }
