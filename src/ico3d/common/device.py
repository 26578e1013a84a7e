"""What users may say about where to compute."""

from typing import Literal

DeviceName = Literal["auto", "cpu", "cuda"]
"""`auto` takes CUDA where it works and the CPU otherwise (`ico3d.splat.device`)."""
