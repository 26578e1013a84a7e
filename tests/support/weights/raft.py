"""torchvision with a network that has RAFT's interface, for machines without either."""

import sys
from pathlib import Path
from types import ModuleType

import torch

NAME = "raft_small_C_T_V2-01064c6d"


class Difference(torch.nn.Module):
    """Has RAFT's interface: two batches of pictures in [-1, 1] in, a list of flows out."""

    def __init__(self):
        super().__init__()
        self.factor = torch.nn.Parameter(torch.zeros(()))

    def forward(self, before, after):
        assert before.shape[2] % 8 == 0 and before.shape[3] % 8 == 0
        assert min(before.shape[2:]) >= 128 and before.abs().max() <= 1
        flow = self.factor * torch.stack([after[:, 0] - before[:, 0], after[:, 1]], 1)
        return [flow * 0, flow]


def install_torchvision(monkeypatch, hub: Path) -> None:
    """Makes `torchvision` importable, and the folder in which weights are looked for `hub`."""
    flows = ModuleType("torchvision.models.optical_flow")
    flows.raft_small = lambda weights, progress: Difference()
    models = ModuleType("torchvision.models")
    models.optical_flow = flows
    monkeypatch.setitem(sys.modules, "torchvision", ModuleType("torchvision"))
    monkeypatch.setitem(sys.modules, "torchvision.models", models)
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(hub))


def write_raft(hub: Path, factor: float) -> None:
    """The file of the network's weights, as torch.hub keeps it."""
    (hub / "checkpoints").mkdir(parents=True)
    torch.save({"factor": torch.tensor(factor)}, hub / "checkpoints" / f"{NAME}.pth")
