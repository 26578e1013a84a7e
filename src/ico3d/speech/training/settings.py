"""Settings of the built-in speech encoder's training."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EncoderSettings:
    """How the built-in encoder is trained; the defaults made the encoder that is part of ico3d.

    Attributes:
        steps: Optimisation steps.
        batch: Utterances per step.
        seconds: Length of an utterance, s.
        learning_rate: Highest learning rate of AdamW, which warms up over 5 % of the steps and then
            falls to 0.
        articulation_weight: Weight of the squared error of articulation; the cross-entropy of
            visemes has weight 1.
        seed: Seed of voices, texts, simulated recordings and initial weights.
    """

    steps: int = 600
    batch: int = 8
    seconds: float = 3.0
    learning_rate: float = 2e-3
    articulation_weight: float = 10.0
    seed: int = 0
