"""How well speech alone moves a person's lips, on words never heard; nothing is drawn.

    python bench/lips/driver.py human_face_f.npz --seeds 0 1 2 --json lips.json

A synthetic person says built-in sentences for 40 s, from which `read_lips` fits the lips as it does
before a head is trained; then other sentences in the same voice, and in another voice in some room.
How far the lips are open is read linearly from the expressions, after a fit on the same 40 s, and
compared with the mesh. A voice that tells its phonemes drives the lips by these as well.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro

from ico3d.capture.face.lip_shapes import MOUTH_LANDMARKS
from ico3d.cli import run_script
from ico3d.measure.lips import LOWER_INNER_LIP, UPPER_INNER_LIP, lip_correlation, lip_lag_ms
from ico3d.speech.encoder import load_encoder
from ico3d.speech.lip_reading import read_lips
from ico3d.speech.mel import FPS, RATE
from ico3d.speech.network import SpeechAdaptor
from ico3d.speech.phonemes import TimedPhonemes
from ico3d.speech.training.augment import recorded
from ico3d.studio.acting.articulation import BILABIALS
from ico3d.studio.acting.performance import Performance, perform
from ico3d.studio.acting.sentences import SENTENCES
from ico3d.studio.choice import load_subject
from ico3d.studio.person.subject import Subject

CLOSED = 0.25
"""Share of the usual range of the opening, from the bottom, in which lips count as closed."""
REACH = 1
"""Frames before and after a p, b or m in which the lips may close: 40 ms."""


@dataclass(frozen=True)
class Spoken:
    """What a person says, and what the lips do.

    Attributes:
        features: (F, D) speech features.
        marks: (F, 68, 3) landmarks of the face, metres.
        opening: (F,) distance of the inner lips, metres.
        closures: (N,) frames amid the closures of p, b and m.
        told: (F, 6) what a voice that tells its phonemes lets one know of the articulation.
    """

    features: np.ndarray
    marks: np.ndarray
    opening: np.ndarray
    closures: np.ndarray
    told: np.ndarray

    @property
    def corrected(self) -> np.ndarray:
        """(F, D) features as a served model moves them to tell the phonemes' articulation."""
        reads = load_encoder().articulation
        assert reads is not None
        weight, bias = (part.numpy() for part in reads)
        missing = self.told[:, :-1] - self.features @ weight.T - bias  # (F, 5)
        moved = self.features + self.told[:, -1:] * (missing @ np.linalg.pinv(weight).T)
        return moved.astype(np.float32)


@dataclass(frozen=True)
class Bench:
    """What to measure.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic.
        seconds: Seconds of speech to learn from, and to test on.
        seeds: Voices, orders of sentences and random weights.
        lively: Whether moods that no sound tells move the mouth as well.
        json: Where to write the figures.
    """

    subject: tyro.conf.Positional[Path]
    seconds: int = 40
    seeds: tuple[int, ...] = (0, 1, 2)
    lively: bool = False
    json: Path | None = None

    def run(self) -> None:
        """Prints, and writes, the figures of each seed."""
        subject, figures = load_subject(str(self.subject)), []
        for seed in self.seeds:
            start = time.process_time()
            found = self._measured(subject, seed)
            figures.append({"seed": seed, **found, "cpu_seconds": time.process_time() - start})
            print(json.dumps(figures[-1]), flush=True)
        if self.json is not None:
            self.json.write_text(json.dumps(figures, indent=1))

    def _measured(self, subject: Subject, seed: int) -> dict[str, dict[str, float]]:
        order = np.random.default_rng(seed).permutation(SENTENCES)
        first, other = " ".join(order[: len(order) // 2]), " ".join(order[len(order) // 2 :])
        heard = self._spoken(subject, first, seed)
        torch.manual_seed(seed)
        adaptor = SpeechAdaptor(heard.features.shape[1])
        shapes = heard.marks[:, MOUTH_LANDMARKS].reshape(len(heard.marks), -1)  # (F, 60)
        read_lips(adaptor, heard.features, np.arange(len(shapes), dtype=float), shapes)
        opens = reading(driven(adaptor, heard.features), heard.opening)
        tests = {
            "trained": heard,
            "other words": self._spoken(subject, other, seed),
            "other voice and room": self._spoken(subject, other, seed + 1, in_room=True),
        }
        figures = {
            name: compared(opens(driven(adaptor, spoken.features)), spoken)
            for name, spoken in tests.items()
        }
        for name in ("other words", "other voice and room"):
            found = opens(driven(adaptor, tests[name].corrected))
            figures[f"{name}, phonemes told"] = compared(found, tests[name])
        return figures

    def _spoken(self, subject: Subject, text: str, seed: int, in_room: bool = False) -> Spoken:
        frames = round(self.seconds * FPS)
        acted = perform(subject, text, frames, FPS, seed, self.lively)
        sound = acted.samples
        if in_room:
            sound = recorded(sound, sound[::-1], np.random.default_rng(seed))
        features = load_encoder().features(sound, RATE)[:frames]
        marks = np.stack([subject.landmarks(subject.posed(row)) for row in acted.weights])
        phonemes = TimedPhonemes()
        phonemes.add(acted.phonemes, 0.0, self.seconds)
        told = phonemes.rows(0, frames)
        assert told is not None
        return Spoken(features, marks, opening(marks), closures(acted, frames), told)


def opening(marks: np.ndarray) -> np.ndarray:
    """(F,) distances of the inner lips of landmarks (F, 68, 3)."""
    between = marks[:, list(UPPER_INNER_LIP)] - marks[:, list(LOWER_INNER_LIP)]  # (F, 3, 3)
    return np.linalg.norm(between, axis=2).mean(1)


def closures(acted: Performance, frames: int) -> np.ndarray:
    """Frames amid each p, b and m that ends in time."""
    starts = [phoneme.time for phoneme in acted.phonemes]
    middles = [
        (starts[i] + starts[i + 1]) / 2
        for i in range(len(starts) - 1)
        if acted.phonemes[i].symbol.strip("ˈˌː")[:1] in BILABIALS
    ]
    rows = np.round(np.array(middles) * FPS).astype(int)
    return rows[(rows > REACH) & (rows < frames - REACH)]


def driven(adaptor: SpeechAdaptor, features: np.ndarray) -> np.ndarray:
    """(F, 32) expressions of features (F, D)."""
    with torch.no_grad():
        return adaptor.track(torch.from_numpy(features)).numpy()


def reading(expressions: np.ndarray, truth: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The linear function of expressions (F, 32) that tells values (F,) best."""
    design = np.c_[expressions, np.ones(len(truth))]
    weights, *_ = np.linalg.lstsq(design, truth, rcond=None)
    return lambda rows: np.c_[rows, np.ones(len(rows))] @ weights


def compared(found: np.ndarray, spoken: Spoken) -> dict[str, float]:
    """Figures of openings (F,), metres.

    Returns:
        `correlation`; `lag_ms`, positive if late; `amplitude`: standard deviation relative to the
        truth's; `closures`: share of p, b and m at which the lips close; `closed_else`: share of
        the frames in which the person's lips are open and these are closed.
    """
    low, high = np.percentile(spoken.opening, (2, 98))
    limit = low + CLOSED * (high - low)
    near = spoken.closures[:, None] + np.arange(-REACH, REACH + 1)  # (N, 3)
    known = np.array([spoken.opening[rows].min() < limit for rows in near])
    hit = np.array([found[rows].min() < limit for rows in near])
    apart = np.array([v.min() >= limit for v in _around(spoken.opening)])
    figures = {
        "correlation": lip_correlation(found, spoken.opening),
        "lag_ms": lip_lag_ms(found, spoken.opening, FPS),
        "amplitude": found.std() / spoken.opening.std(),
        "closures": hit[known].mean(),
        "closed_else": (found < limit)[apart].mean(),
    }
    return {name: round(float(value or 0), 3) for name, value in figures.items()}


def _around(values: np.ndarray) -> np.ndarray:
    """(F, 3): the values (F,) before, at and after each frame."""
    padded = np.pad(values, REACH, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * REACH + 1)


if __name__ == "__main__":
    sys.exit(run_script(Bench))
