"""Trains the built-in speech encoder on synthetic voices (torch)."""

import hashlib
import json
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from ico3d.common.files import write_atomic
from ico3d.common.unpacking.heads import check_head
from ico3d.common.unpacking.weights import load_weights
from ico3d.common.visemes import VISEMES
from ico3d.errors import ModelError, SettingsError
from ico3d.speech.articulation import ARTICULATION
from ico3d.speech.network import BUILTIN_SIZE, BuiltinEncoder, ConvBlock
from ico3d.speech.training.corpus import Batch, make_batch
from ico3d.speech.training.settings import EncoderSettings

_SHIFTS = (-4, 0, 4)  # mel rows (50 ms): each window also tells what was and what comes
_CHECKPOINT_EVERY = 50
_READOUT = "readout."
_STATISTICS_BATCHES = 8


class Readout(nn.Module):
    """Linear layers from features to visemes and articulation; only for training and evaluation."""

    def __init__(self):
        """Builds the layers with random weights."""
        super().__init__()
        self.visemes = nn.Linear(BUILTIN_SIZE, len(VISEMES) * len(_SHIFTS))
        self.articulation = nn.Linear(BUILTIN_SIZE, len(ARTICULATION))

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Features (…, D) to viseme logits (…, 3, 15) and articulation values (…, 5).

        The three rows of logits are for times before, at and after the features' time.
        """
        logits = self.visemes(features).unflatten(-1, (len(_SHIFTS), len(VISEMES)))
        return logits, self.articulation(features)


class EncoderTraining:
    """A training run: network, readout, optimiser and progress."""

    def __init__(self, settings: EncoderSettings, checkpoint: Path):
        """Starts with random weights, or continues from the checkpoint if it exists.

        Raises:
            SettingsError: If the checkpoint was made with other settings.
        """
        torch.manual_seed(settings.seed)
        self.settings = settings
        # type: ignore (missing in its stub)
        self.network = BuiltinEncoder(normalise=True).to(memory_format=torch.channels_last)
        self.readout = Readout()
        parameters = [*self.network.parameters(), *self.readout.parameters()]
        self._optimiser = torch.optim.AdamW(parameters, settings.learning_rate, weight_decay=0.01)
        self.step = 0
        self._checkpoint = checkpoint
        if os.path.exists(checkpoint):
            self._resume()

    def run(self) -> Iterator[dict[str, float]]:
        """Trains to the last step; yields the numbers of every step."""
        with ThreadPoolExecutor(1) as pool:  # the next batch is made while this one trains
            following = pool.submit(self._batch, self.step)
            while self.step < self.settings.steps:
                batch = following.result()
                following = pool.submit(self._batch, self.step + 1)
                yield self._train(batch)
                self.step += 1
                if self.step % _CHECKPOINT_EVERY == 0 or self.step == self.settings.steps:
                    self._save()

    def _batch(self, step: int) -> Batch:
        """What step `step` learns from, whether the run was interrupted or not."""
        random = np.random.default_rng([self.settings.seed, step])
        return make_batch(random, self.settings.batch, self.settings.seconds, held_out=False)

    def _train(self, batch: Batch) -> dict[str, float]:
        """One step."""
        for group in self._optimiser.param_groups:
            group["lr"] = self.settings.learning_rate * _schedule(self.step / self.settings.steps)
        self.network.train()
        features = self.network.dense(_channels_last(batch.mel))  # (b, D, T)
        logits, values = self.readout(features.transpose(1, 2))  # (b, T, 3, 15), (b, T, 5)
        truth = torch.from_numpy(batch.visemes)  # (b, T)
        entropy = torch.stack([_entropy(logits[:, :, i], truth, s) for i, s in enumerate(_SHIFTS)])
        error = functional.mse_loss(values, torch.from_numpy(batch.articulation))
        loss = entropy.mean() + self.settings.articulation_weight * error
        self._optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self._optimiser.step()
        correct = (logits[:, :, 1].argmax(-1) == truth).float().mean()
        return {"loss": loss.item(), "accuracy": correct.item(), "articulation": error.item()}

    def _save(self) -> None:
        """Writes everything that the rest of the run depends on."""
        state = {
            "settings": asdict(self.settings),
            "step": self.step,
            "network": self.network.state_dict(),
            "readout": self.readout.state_dict(),
            "optimiser": self._optimiser.state_dict(),
        }
        write_atomic(self._checkpoint, lambda path: torch.save(state, path))

    def _resume(self) -> None:
        """Takes over the checkpoint."""
        try:
            state = load_weights(self._checkpoint, None)
            if state["settings"] != asdict(self.settings):
                raise SettingsError(
                    f"{self._checkpoint.parent} holds a training with other settings: "
                    "use the same ones, or another folder."
                )
            self.network.load_state_dict(state["network"])
            self.readout.load_state_dict(state["readout"])
            self._optimiser.load_state_dict(state["optimiser"])
            self.step = int(state["step"])
        except (ModelError, SettingsError):
            raise
        except Exception as error:  # torch raises errors of many kinds for damaged files
            raise ModelError(f"{self._checkpoint} holds no training of an encoder.") from error

    def finished(self) -> tuple[BuiltinEncoder, Readout]:
        """Encoder and readout for use after training.

        Batch normalisation is merged into the convolutions, and features are scaled to mean 0 and
        deviation 1.
        """
        plain = BuiltinEncoder()
        state = {}
        for index, block in enumerate(self.network.blocks):
            assert isinstance(block, ConvBlock)
            weight, bias = block.folded()
            state[f"blocks.{index}.conv_block.0.weight"] = weight
            state[f"blocks.{index}.conv_block.0.bias"] = bias
        state |= {f"project.{k}": v for k, v in self.network.project.state_dict().items()}
        plain.load_state_dict(state)
        plain.eval().requires_grad_(False)
        readout = Readout()
        readout.load_state_dict(self.readout.state_dict())
        readout.requires_grad_(False)
        unseen = range(self.settings.steps, self.settings.steps + _STATISTICS_BATCHES)
        _standardise(plain, readout, [self._batch(step) for step in unseen])
        return plain.half().float(), readout.half().float()


def _channels_last(mel: np.ndarray) -> torch.Tensor:
    """Mel rows (b, 80, M) as an image (b, 1, 80, M), in the faster memory order."""
    return torch.from_numpy(mel)[:, None].to(memory_format=torch.channels_last)


def _schedule(progress: float) -> float:
    """Learning rate factor: linear warm-up, then half a cosine."""
    if progress < 0.05:
        return (progress + 1e-3) / 0.05
    return 0.5 * (1 + float(np.cos(np.pi * (progress - 0.05) / 0.95)))


def _entropy(logits: torch.Tensor, truth: torch.Tensor, shift: int) -> torch.Tensor:
    """Cross-entropy of logits (b, T, 15) against the truth (b, T) `shift` rows later."""
    count = truth.shape[1]
    first, last = max(0, -shift), count - max(0, shift)
    here, there = logits[:, first:last], truth[:, first + shift : last + shift]
    return functional.cross_entropy(here.flatten(0, 1), there.flatten())


def _standardise(network: BuiltinEncoder, readout: Readout, batches: list[Batch]) -> None:
    """Moves mean and deviation of the features into the last layer, and out of the readout."""
    mel = torch.from_numpy(np.concatenate([batch.mel for batch in batches]))[:, None]
    features = network.dense(mel).transpose(1, 2).flatten(0, 1)  # (n, D)
    mean, deviation = features.mean(0), features.std(0)
    assert network.project.bias is not None
    network.project.weight /= deviation[:, None, None, None]
    network.project.bias.sub_(mean).div_(deviation)
    for layer in (readout.visemes, readout.articulation):
        layer.bias.add_(layer.weight @ mean)
        layer.weight *= deviation


def evaluate(network: BuiltinEncoder, readout: Readout, batches: list[Batch]) -> dict:
    """Measures what features tell about speech, on held-out voices, languages and words.

    Returns:
        `viseme_accuracy`: share of windows; `viseme_recall`: by viseme; and, for each articulation
        value, its `correlation` with the truth and `lag_ms`, which is positive if the value is
        late.
    """
    mel = torch.from_numpy(np.concatenate([batch.mel for batch in batches]))[:, None]
    truth = np.concatenate([batch.visemes for batch in batches])  # (b, T)
    wanted = np.concatenate([batch.articulation for batch in batches])  # (b, T, 5)
    with torch.no_grad():
        logits, values = readout(network.dense(mel).transpose(1, 2))
    found = logits[:, :, 1].argmax(-1).numpy()  # (b, T)
    said = [(i, name) for i, name in enumerate(VISEMES) if i in truth]
    recall = {name: float((found == i)[truth == i].mean()) for i, name in said}
    columns = [(values.numpy()[:, :, i], wanted[:, :, i]) for i in range(len(ARTICULATION))]
    return {
        "viseme_accuracy": float((found == truth).mean()),
        "viseme_recall": recall,
        "correlation": {n: _correlation(*c) for n, c in zip(ARTICULATION, columns, strict=True)},
        "lag_ms": {n: _lag_ms(*c) for n, c in zip(ARTICULATION, columns, strict=True)},
    }


def _correlation(found: np.ndarray, wanted: np.ndarray) -> float:
    """Pearson's, over all utterances and times."""
    return float(np.corrcoef(found.ravel(), wanted.ravel())[0, 1])


def _lag_ms(found: np.ndarray, wanted: np.ndarray, reach: int = 8) -> float:
    """Where tracks (b, T) correlate most: a parabola through the peak, positive = late."""
    inner = wanted[:, reach:-reach]
    count = wanted.shape[1]
    shifts = np.arange(-reach, reach + 1)
    scores = [_correlation(found[:, reach + s : count - reach + s], inner) for s in shifts]
    peak = int(np.clip(np.argmax(scores), 1, 2 * reach - 1))
    before, top, after = scores[peak - 1 : peak + 2]
    return float((shifts[peak] + 0.5 * (before - after) / (before - 2 * top + after)) * 12.5)


def save_encoder(folder: Path, network: BuiltinEncoder, readout: Readout, card: dict) -> None:
    """Writes `encoder.safetensors` (half precision) and `encoder.json` (the contents of `card`)."""
    from safetensors.torch import save

    state = dict(network.state_dict())
    state |= {_READOUT + key: value for key, value in readout.state_dict().items()}
    data = save({key: value.half().contiguous() for key, value in state.items()})
    write_atomic(folder / "encoder.safetensors", data)
    card = {**card, "sha256": hashlib.sha256(data).hexdigest()}
    write_atomic(folder / "encoder.json", (json.dumps(card, indent=1) + "\n").encode())


def load_readout(path: Path) -> Readout:
    """Loads the readout from an encoder's file.

    Raises:
        ModelError: If the file has no readout.
    """
    from safetensors.torch import load_file

    readout = Readout()
    try:
        check_head(path)
        state = load_file(path)
        readout.load_state_dict(
            {k.removeprefix(_READOUT): v.float() for k, v in state.items() if _READOUT in k}
        )
    except (RuntimeError, ValueError):
        raise ModelError(f"{path} holds no readout: train it with ico3d train speech.") from None
    return readout.requires_grad_(False)
