"""Pretrained speech encoders by name, with frozen weights: built-in, SyncTalk's, HuBERT (torch)."""

import warnings
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import nn

from ico3d.common.catalogue.table import TABLE
from ico3d.common.downloads.fetching import sha256
from ico3d.common.files import read_small
from ico3d.common.unpacking.heads import MOST_HEAD, bounded_head
from ico3d.common.unpacking.weights import load_weights
from ico3d.common.weights import model_file, model_of
from ico3d.errors import ModelError, SettingsError
from ico3d.speech.blocks import sound_blocks
from ico3d.speech.hubert import VECTORS, load_network, weight_file
from ico3d.speech.mel import mel_windows
from ico3d.speech.network import AudioEncoder, BuiltinEncoder

EncoderName = Literal["builtin", "ave", "hubert"]

BUILTIN_FILE = Path(__file__).parent / "data" / "encoder.safetensors"
AVE_FILE = TABLE["ave"].files[0].name

CPU = torch.device("cpu")
_BATCH = {"mel": 256, "sound": 8}  # windows at once


@dataclass(frozen=True)
class FrozenEncoder:
    """A speech encoder whose weights are not trained any further.

    Attributes:
        name: `builtin`, `ave` or `hubert`.
        size: D, number of features per row.
        sha256: SHA-256 of the file of weights.
        network: Maps mel windows (b, 1, 80, 16) to (b, D), or windows of sound (b, SIZE) to (b, 5,
            D).
        input: What the network reads: `mel` windows, or windows of the `sound` itself (see
            `blocks`).
        vectors: Number of vectors that are concatenated to the D features of a row.
        articulation: Weight (5, D) and bias (5,) by which features tell the lips' articulation
            (`articulation.ARTICULATION`); None where nothing was learnt to read it.
    """

    name: str
    size: int
    sha256: str
    network: nn.Module
    input: Literal["mel", "sound"] = "mel"
    vectors: int = 1
    articulation: tuple[torch.Tensor, torch.Tensor] | None = None

    @torch.no_grad()
    def features(self, samples: np.ndarray, rate: int, device: torch.device = CPU) -> np.ndarray:
        """Computes the features of a whole sound.

        Args:
            samples: (S,) in [-1, 1].
            rate: Samples per second.
            device: Where to compute them.

        Returns:
            (T, D) float32; row i belongs to time i/25 s, T ≥ ⌊25·seconds⌋ + 1.
        """
        if self.input == "mel":
            return self._run(mel_windows(samples, rate)[:, None], device)
        blocks, count = sound_blocks(samples, rate)
        return self._run(blocks, device).reshape(-1, self.size)[:count]

    def _run(self, windows: np.ndarray, device: torch.device) -> np.ndarray:
        """What the network says about windows (n, …)."""
        batches = torch.from_numpy(windows).split(_BATCH[self.input])
        self.network.to(device)
        try:
            return torch.cat([self.network(batch.to(device)).cpu() for batch in batches]).numpy()
        finally:
            self.network.to(CPU)  # it is shared, and exported from there


def load_encoder(name: str = "builtin") -> FrozenEncoder:
    """Loads a speech encoder by name.

    Args:
        name: `builtin` (part of ico3d), `ave` (SyncTalk's) or `hubert`; weights of the last two are
            searched for by `ico3d.common.weights`.

    Raises:
        SettingsError: If no encoder has this name.
        MissingModelError: If the weights are not installed.
        MissingExtraError: If HuBERT is wanted and transformers is not installed.
        ModelError: If the file holds the weights of another network.
    """
    if name == "builtin":
        return load_builtin(BUILTIN_FILE)
    if name == "ave":
        return load_ave(model_file(AVE_FILE, "SyncTalk's audio-visual encoder"))
    if name == "hubert":
        return load_hubert(model_of("hubert"))
    raise SettingsError(
        f"there is no speech encoder '{name}': choose 'builtin', 'ave' or 'hubert'."
    )


def load_builtin(path: Path) -> FrozenEncoder:
    """Loads a built-in encoder from a file that `ico3d train speech` wrote."""
    from safetensors.torch import load

    data = _read(path)
    try:
        bounded_head(data, MOST_HEAD)
    except ValueError as error:
        raise ModelError(f"{path} holds no encoder: {error}.") from error
    state = {key: value.float() for key, value in load(data).items() if "readout" not in key}
    encoder = _frozen("builtin", BuiltinEncoder(), state, sha256(path), path)
    read = [load(data).get(f"readout.articulation.{name}") for name in ("weight", "bias")]
    if read[0] is None or read[1] is None:
        return encoder
    return replace(encoder, articulation=(read[0].float(), read[1].float()))


def load_ave(path: Path) -> FrozenEncoder:
    """Loads SyncTalk's encoder from its published file; logs its licence as a warning.

    Raises:
        ModelError: If the file cannot be read or does not hold this encoder.
    """
    warnings.warn(TABLE["ave"].notice, stacklevel=2)
    try:
        prefix = "audio_encoder."
        state = {key.removeprefix(prefix): value for key, value in load_weights(path).items()}
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{path} cannot be read as weights: {error}") from None
    return _frozen("ave", AudioEncoder(), state, sha256(path), path)


def load_hubert(folder: Path) -> FrozenEncoder:
    """Loads HuBERT from a folder in the layout of transformers.

    The last encoder that was loaded is cached, so that a second call is fast.
    """
    path = weight_file(folder)
    return _hubert(path, path.stat().st_mtime_ns)


@lru_cache(1)
def _hubert(path: Path, written: int) -> FrozenEncoder:
    """HuBERT with weights that were written at some time: they take seconds to load."""
    network = load_network(path.parent).eval().requires_grad_(False)
    return FrozenEncoder("hubert", network.size, sha256(path), network, "sound", VECTORS)


def _read(path: Path) -> bytes:
    """The bytes of a file of the built-in encoder."""
    try:
        return read_small(path)
    except OSError as error:
        raise ModelError(f"the speech encoder {path} cannot be read: {error.strerror}.") from None


def _frozen(
    name: str, network: nn.Module, state: dict[str, torch.Tensor], digest: str, path: Path
) -> FrozenEncoder:
    """Puts weights into a network and takes their gradients away."""
    try:
        network.load_state_dict(state)
    except RuntimeError:
        raise ModelError(f"{path} does not hold the speech encoder '{name}'.") from None
    network.eval().requires_grad_(False)
    size = int(getattr(network, "size"))  # noqa: B009 - nn.Module hides class attributes
    return FrozenEncoder(name, size, digest, network)
