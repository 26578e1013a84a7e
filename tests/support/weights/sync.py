"""Made-up weights of SyncNet and S3FD in the format of the public files."""

import numpy as np
import torch
from torch import Tensor, nn

SCALES = {"netcnnlip.0.": 0.01, "netcnnaud.0.": 0.05, "vgg.0.": 0.01} | {
    f"{part}.{k}.": scale for part, scale in (("loc", 0.3), ("conf", 30.0)) for k in range(6)
}
"""Factors of weights that keep features near 1 and faces near the picture."""


def made_up(network: nn.Module, seed: int) -> dict[str, Tensor]:
    """A state dictionary with the network's names: the same numbers for a seed on any machine."""
    rng = np.random.default_rng(seed)
    state = {}
    for name, value in sorted(network.state_dict().items()):
        shape = tuple(value.shape)
        if name.endswith("num_batches_tracked"):
            state[name] = torch.zeros(shape, dtype=torch.long)
            continue
        if name.endswith("running_var") or (len(shape) == 1 and name.endswith("weight")):
            numbers = 0.5 + rng.random(shape, np.float32)
        else:
            inputs = int(np.prod(shape[1:])) if len(shape) > 1 else 25
            numbers = rng.random(shape, np.float32) - 0.5
            numbers *= (24 / inputs) ** 0.5  # a variance of 2 over the number of inputs
            numbers *= SCALES.get(name.removesuffix("weight"), 1.0)
        state[name] = torch.from_numpy(np.asarray(numbers, np.float32))
    return state


def made_up_features(count: int = 40, late: int = 4, seed: int = 9) -> tuple[Tensor, Tensor]:
    """Features (count, 64) of lips and of sound, which is `late` frames behind the lips."""
    rng = np.random.default_rng(seed)
    common = rng.random((count + late, 64))
    lips, sound = common[late:], common[:count]
    noisy = lips + 0.3 * rng.random((count, 64))
    return torch.from_numpy(noisy).float(), torch.from_numpy(sound).float()


def made_up_faces(count: int, seed: int = 5) -> np.ndarray:
    """Pictures uint8 (count, 224, 224, 3) of stripes that move."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:224, :224]
    pictures = [
        128 + 100 * np.sin((rows * rng.random() + columns * rng.random()) / 5 + k)
        for k in range(count * 3)
    ]
    return np.stack(pictures).reshape(count, 3, 224, 224).transpose(0, 2, 3, 1).astype(np.uint8)


def made_up_sound(seconds: float, seed: int = 6) -> np.ndarray:
    """Noise of changing loudness, int16 at 16 kHz."""
    rng = np.random.default_rng(seed)
    count = round(seconds * 16_000)
    loud = 2000 * (1 + np.sin(np.arange(count) / 900))
    return (loud * rng.uniform(-1, 1, count)).astype(np.int16)
