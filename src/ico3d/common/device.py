"""The names by which users choose the device to compute on."""

from typing import Literal

DeviceName = Literal["auto", "cpu", "cuda"]
"""`auto` takes CUDA where CUDA works, else the CPU (`ico3d.splat.device` decides)."""
