"""ico3d: photorealistic 3D Gaussian people that anyone can talk with."""

__version__ = "0.1.0"
