"""Optical flow between two pictures: RAFT where it is installed, else OpenCV's DIS."""

import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ico3d.capture import extras
from ico3d.common.unpacking.weights import load_weights
from ico3d.common.weights import model_folders

if TYPE_CHECKING:
    import torch

RAFT_CHECKPOINTS = {
    "raft_large": "raft_large_C_T_SKHT_V2-ff5fadd5.pth",
    "raft_small": "raft_small_C_T_V2-01064c6d.pth",
}
"""torchvision's builders of RAFT, best first, and the files of their weights.

The files are looked for in the folders of ico3d's models and in the cache of torch.hub.
"""
RAFT_SMALLEST = 128
"""Least side of a picture in pixels that RAFT takes."""


class FlowMethod(Protocol):
    """A method of optical flow.

    Attributes:
        name: Method and version, so that cached results of other methods are told apart.
    """

    name: str

    def __call__(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """The flow (H, W, 2) in pixels from one picture (H, W, 3) uint8 RGB to the next."""
        ...


class DisFlow:
    """Dense inverse search (Kroeger et al. 2016), medium preset."""

    name = "dis"

    def __init__(self):
        """Sets the method up.

        Raises:
            MissingExtraError: If OpenCV is not installed.
        """
        cv2 = opencv()
        self._dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        # Pictures show people before black, and normalised patches miss fast limbs. On a synthetic
        # body whose hands move by up to 27 cm per step, 80 % of the true squared motion is found,
        # instead of 67 % with normalisation, and 42 % with the background in the picture.
        self._dis.setUseMeanNormalization(False)

    def __call__(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """The flow (H, W, 2) in pixels from one picture (H, W, 3) uint8 RGB to the next."""
        cv2 = opencv()
        gray = [cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in (before, after)]
        with _one_thread(cv2):
            return self._dis.calc(*gray, None)


@contextmanager
def _one_thread(cv2: Any) -> Iterator[None]:
    """Limits OpenCV to one thread: with small pictures on busy cores, threads only wait."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


class RaftFlow:
    """RAFT (Teed and Deng 2020), torchvision's implementation."""

    def __init__(self, builder: str, checkpoint: Path, device: "torch.device | str"):
        """Loads the weights.

        Args:
            builder: Name of torchvision's builder, a key of `RAFT_CHECKPOINTS`.
            checkpoint: File of the network's state dictionary.
            device: Where to compute.
        """
        from torchvision.models import optical_flow

        self.name = checkpoint.stem
        self._device = device
        self._network = getattr(optical_flow, builder)(weights=None, progress=False)
        self._network.load_state_dict(load_weights(checkpoint))
        self._network.to(self._device).eval()

    def __call__(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """The flow (H, W, 2) in pixels from one picture (H, W, 3) uint8 RGB to the next."""
        import torch

        height, width = before.shape[:2]
        # RAFT takes sides that are multiples of 8: the border is repeated up to these.
        rows, columns = (max(-(-side // 8) * 8, RAFT_SMALLEST) - side for side in (height, width))
        padded = [
            np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge")
            for picture in (before, after)
        ]
        batch = torch.from_numpy(np.stack(padded)).to(self._device)  # (2, H', W', 3)
        batch = batch.permute(0, 3, 1, 2) / 127.5 - 1  # (2, 3, H', W')
        with torch.inference_mode():
            flow = self._network(batch[:1], batch[1:])[-1][0]  # (2, H', W')
        return flow[:, :height, :width].permute(1, 2, 0).cpu().numpy()  # (H, W, 2)


def best_method(device: "torch.device | str" = "cpu") -> FlowMethod:
    """RAFT where torchvision and weights are installed (nothing is downloaded), else DIS.

    Args:
        device: Where RAFT computes; DIS always computes on the CPU.

    Raises:
        MissingExtraError: If neither RAFT nor OpenCV is installed.
    """
    found = _raft()
    return DisFlow() if found is None else RaftFlow(*found, device)


def _raft() -> tuple[str, Path] | None:
    """Name of RAFT's builder and file of its weights; None where torchvision or weights lack."""
    import torch

    try:
        import torchvision  # noqa: F401
    except ImportError:
        return None
    folders = (*model_folders(), Path(torch.hub.get_dir()) / "checkpoints")
    choices = itertools.product(RAFT_CHECKPOINTS.items(), folders)
    files = ((builder, folder / name) for (builder, name), folder in choices)
    return next(((builder, file) for builder, file in files if os.path.isfile(file)), None)


def opencv() -> Any:
    """The module cv2.

    Raises:
        MissingExtraError: If OpenCV is not installed.
    """
    return extras.opencv("optical flow")
