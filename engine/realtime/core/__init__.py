"""What Orbit and Deform share: points, pixels, maps, and the parts that a graphics card draws."""
