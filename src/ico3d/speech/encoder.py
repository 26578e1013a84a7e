"""Frozen speech encoders: the built-in one and SyncTalk's, by name (torch)."""

import hashlib
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import nn

from ico3d.common.weights import model_file
from ico3d.errors import ModelError, SettingsError
from ico3d.speech.mel import mel_windows
from ico3d.speech.network import AudioEncoder, BuiltinEncoder

EncoderName = Literal["builtin", "ave"]

BUILTIN_FILE = Path(__file__).parent / "data" / "encoder.safetensors"
AVE_FILE = "audio_visual_encoder.pth"
AVE_LICENCE = (
    "SyncTalk's audio-visual encoder is licensed CC BY-NC 4.0: "
    "avatars that use it are for non-commercial purposes."
)

_BATCH = 256  # windows at once


@dataclass(frozen=True)
class FrozenEncoder:
    """An encoder whose weights stay as they are.

    Attributes:
        name: `builtin` or `ave`.
        size: D, the number of features per row.
        sha256: Of the file that holds the weights.
        network: (b, 1, 80, 16) mel windows to (b, D).
    """

    name: str
    size: int
    sha256: str
    network: nn.Module

    @torch.no_grad()
    def features(self, samples: np.ndarray, rate: int) -> np.ndarray:
        """Features of a whole sound.

        Args:
            samples: (S,) in [-1, 1].
            rate: Samples per second.

        Returns:
            (T, D) float32; row i belongs to time i/25 s, T ≥ ⌊25·seconds⌋ + 1.
        """
        windows = torch.from_numpy(mel_windows(samples, rate)).unsqueeze(1)  # (T, 1, 80, 16)
        rows = [self.network(batch) for batch in windows.split(_BATCH)]
        return torch.cat(rows).numpy()


def load_encoder(name: str = "builtin") -> FrozenEncoder:
    """Loads an encoder by its name.

    Args:
        name: `builtin` (comes with the package) or `ave` (SyncTalk's; the user's own copy of its
            file is found by `model_file`).

    Raises:
        SettingsError: If there is no such encoder.
        MissingModelError: If the user's file is not there.
        ModelError: If the file does not hold this encoder.
    """
    if name == "builtin":
        return load_builtin(BUILTIN_FILE)
    if name == "ave":
        return load_ave(model_file(AVE_FILE, "SyncTalk's audio-visual encoder"))
    raise SettingsError(f"there is no speech encoder '{name}': choose 'builtin' or 'ave'.")


def load_builtin(path: Path) -> FrozenEncoder:
    """Loads a built-in encoder that `ico3d train speech` wrote."""
    from safetensors.torch import load

    data = _read(path)
    state = {key: value.float() for key, value in load(data).items() if "readout" not in key}
    return _frozen("builtin", BuiltinEncoder(), state, data, path)


def load_ave(path: Path) -> FrozenEncoder:
    """Loads SyncTalk's encoder from its published file; its licence is told as a warning."""
    warnings.warn(AVE_LICENCE, stacklevel=2)
    data = _read(path)
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:
        raise ModelError(f"{path} cannot be read as weights: {error}") from None
    prefix = "audio_encoder."
    state = {key.removeprefix(prefix): value for key, value in state.items()}
    return _frozen("ave", AudioEncoder(), state, data, path)


def _read(path: Path) -> bytes:
    """The bytes of a weight file."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise ModelError(f"the speech encoder {path} cannot be read: {error.strerror}.") from None


def _frozen(
    name: str, network: nn.Module, state: dict[str, torch.Tensor], data: bytes, path: Path
) -> FrozenEncoder:
    """Puts weights into a network and takes their gradients away."""
    try:
        network.load_state_dict(state)
    except RuntimeError:
        raise ModelError(f"{path} does not hold the speech encoder '{name}'.") from None
    network.eval().requires_grad_(False)
    size = int(getattr(network, "size"))  # noqa: B009 - nn.Module hides class attributes
    return FrozenEncoder(name, size, hashlib.sha256(data).hexdigest(), network)
