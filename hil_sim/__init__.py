"""A laboratory in software: robot, load and sensors around the real firmware core."""
