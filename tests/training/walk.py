"""A training of three numbers."""

import numpy as np
import torch

from ico3d.training.optimiser import Optimiser


class Walk:
    """Fits a vector to noisy targets; dies where it is told to."""

    def __init__(self, seed: int = 0, die_at: int | None = None, break_at: int | None = None):
        self.seed, self.die_at, self.break_at = seed, die_at, break_at
        self.weight, self.optimiser, self.calls = torch.zeros(3), Optimiser(), 0

    def step(self, index: int) -> dict[str, float]:
        if index == self.die_at:
            raise KeyboardInterrupt
        self.calls += 1
        noise = np.random.default_rng([self.seed, index]).normal(size=3)
        gradient = self.weight - torch.from_numpy(1 + noise).float()
        if index == self.break_at:
            gradient[1] = torch.nan
        self.optimiser.update("weight", self.weight, gradient, 0.1)
        return {"loss": float(self.weight.square().sum())}

    def tensors(self) -> dict[str, torch.Tensor]:
        return {"weight": self.weight, **self.optimiser.moments}

    def place(self, name: str) -> torch.device:
        return torch.device("cpu")

    def state(self) -> dict:
        return {"calls": self.calls}

    def restore(self, tensors: dict[str, torch.Tensor], state: dict) -> None:
        self.weight = tensors.pop("weight")
        self.optimiser.moments = tensors
        self.calls = state["calls"]
