"""SyncNet: two networks that put five frames of a mouth and 0.2 s of sound into one space."""

from collections.abc import Sequence
from pathlib import Path

from torch import Tensor, nn

from ico3d.common.unpacking.weights import load_weights
from ico3d.common.weights import model_file
from ico3d.errors import ModelError

WEIGHTS = "syncnet_v2.model"
"""File of the authors' weights, a PyTorch state dictionary."""
FRAMES = 5
"""Frames that the network looks at together."""
COLUMNS, STRIDE = 20, 4
"""Rows of MFCC that the network hears together, and rows per frame at 25 frames per second."""
SIDE = 224
"""Side in pixels of the pictures of a face."""
FEATURES = 1024


class SyncNet(nn.Module):
    """The two-stream network of Chung and Zisserman (Out of time, 2016), version 2.

    Modules are named and numbered as in the authors' file of weights. Its convolutions over time
    have no padding and, but for the first, a width of one frame: a clip of T + 4 frames gives what
    T clips of five frames give, and each frame is looked at once.
    """

    def __init__(self):
        """Makes the network with PyTorch's initial weights, ready for measuring."""
        super().__init__()
        self.netcnnaud = nn.Sequential(
            *_block(nn.Conv2d(1, 64, 3, padding=1)),
            nn.MaxPool2d(1, 1),
            *_block(nn.Conv2d(64, 192, 3, padding=1)),
            nn.MaxPool2d(3, (1, 2)),
            *_block(nn.Conv2d(192, 384, 3, padding=1)),
            *_block(nn.Conv2d(384, 256, 3, padding=1)),
            *_block(nn.Conv2d(256, 256, 3, padding=1)),
            nn.MaxPool2d(3, 2),
            *_block(nn.Conv2d(256, 512, (5, 4))),
        )
        self.netcnnlip = nn.Sequential(
            *_block(nn.Conv3d(3, 96, (5, 7, 7), (1, 2, 2))),
            nn.MaxPool3d((1, 3, 3), (1, 2, 2)),
            *_block(nn.Conv3d(96, 256, (1, 5, 5), (1, 2, 2), (0, 1, 1))),
            nn.MaxPool3d((1, 3, 3), (1, 2, 2), (0, 1, 1)),
            *_block(nn.Conv3d(256, 256, (1, 3, 3), padding=(0, 1, 1))),
            *_block(nn.Conv3d(256, 256, (1, 3, 3), padding=(0, 1, 1))),
            *_block(nn.Conv3d(256, 256, (1, 3, 3), padding=(0, 1, 1))),
            nn.MaxPool3d((1, 3, 3), (1, 2, 2)),
            *_block(nn.Conv3d(256, 512, (1, 6, 6))),
        )
        self.netfcaud, self.netfclip = _head(), _head()
        self.eval().requires_grad_(False)

    def hear(self, columns: Tensor) -> Tensor:
        """Features (N, 1024) of pieces of MFCC (N, 13, 20)."""
        seen = self.netcnnaud(columns[:, None])  # (N, 512, 1, 1)
        return self.netfcaud(seen.flatten(1))

    def watch(self, frames: Tensor) -> Tensor:
        """Features of a clip, one row for each five consecutive frames.

        Args:
            frames: (T + 4, 224, 224, 3) blue, green, red from 0 to 255.

        Returns:
            (T, 1024).
        """
        clip = frames.permute(3, 0, 1, 2)[None]  # (1, 3, T + 4, 224, 224)
        seen = self.netcnnlip(clip)  # (1, 512, T, 1, 1)
        return self.netfclip(seen[0, :, :, 0, 0].T)


def load_syncnet() -> SyncNet:
    """SyncNet with the authors' weights.

    Raises:
        MissingModelError: If the weights are not installed.
        ModelError: If the file does not hold them.
    """
    network = SyncNet()
    load_state(network, model_file(WEIGHTS, "measuring lip synchronisation"))
    return network


def load_state(network: nn.Module, path: Path) -> None:
    """Loads a PyTorch state dictionary; nothing that the file asks for is run.

    Raises:
        ModelError: If the file is none, or belongs to another network.
    """
    try:
        network.load_state_dict(load_weights(path))
    except ModelError:
        raise
    except Exception as error:  # torch raises errors of many kinds for damaged files
        reason = str(error).strip().split("\n")[0]
        name = type(network).__name__
        raise ModelError(f"{path} does not hold the weights of {name}: {reason}") from error


def _block(convolution: nn.Conv2d | nn.Conv3d) -> Sequence[nn.Module]:
    """A convolution with normalisation and ReLU."""
    normalised = nn.BatchNorm2d if isinstance(convolution, nn.Conv2d) else nn.BatchNorm3d
    return convolution, normalised(convolution.out_channels), nn.ReLU()


def _head() -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(512, 512), nn.BatchNorm1d(512), nn.ReLU(), nn.Linear(512, FEATURES)
    )
