"""From a photograph of a scene to its camera and the material of one of its objects."""
