"""A trial whose result is known, for processes that start afresh."""

from dataclasses import dataclass
from pathlib import Path

import numba
import torch


@dataclass(frozen=True)
class MadeTrial:
    method: str
    seed: int
    folder: Path

    def run(self):
        print(f"here is {self.method} {self.seed}")
        if self.method == "broken":
            raise RuntimeError("broken")
        return {"seed": self.seed, "threads": [torch.get_num_threads(), numba.get_num_threads()]}
