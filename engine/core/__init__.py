"""What all of the engine shares: colour, errors, step-by-step work, threads, safe files, and arrays in a cache."""
