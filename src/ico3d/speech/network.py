"""Speech encoders and the adaptor that turns their features into expression values (torch)."""

import itertools

import torch
from torch import nn
from torch.nn import functional

from ico3d.common.expression import SPEECH_SIZE
from ico3d.speech.runtime import AFTER, BEFORE

AVE_SIZE = 512
BUILTIN_SIZE = 64
ATTENTION_WINDOW = BEFORE + 1 + AFTER

_SLOPE = 0.02  # of the leaky ReLUs


class ConvBlock(nn.Module):
    """Convolution, batch normalisation, the input added if residual, ReLU.

    Attributes:
        conv_block: The convolution and, unless it is folded into it, the normalisation.
        residual: Whether the input is added.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        kernel: int | tuple[int, int],
        stride: int | tuple[int, int] = 1,
        padding: int | tuple[int, int] = 0,
        dilation: int | tuple[int, int] = 1,
        residual: bool = False,
        normalise: bool = True,
    ):
        """Takes the arguments of `nn.Conv2d`, then whether it is residual and normalised."""
        super().__init__()
        conv = nn.Conv2d(inputs, outputs, kernel, stride, padding, dilation)
        layers = [conv, nn.BatchNorm2d(outputs)] if normalise else [conv]
        self.conv_block = nn.Sequential(*layers)
        self.residual = residual

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(b, inputs, h, w) to (b, outputs, h', w')."""
        y = self.conv_block(x)
        return torch.relu(y + x if self.residual else y)

    def folded(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Weight and bias of the one convolution that does what the block does before its ReLU."""
        conv = self.conv_block[0]
        assert isinstance(conv, nn.Conv2d) and conv.bias is not None
        if len(self.conv_block) == 1:
            return conv.weight, conv.bias
        norm = self.conv_block[1]
        assert isinstance(norm, nn.BatchNorm2d)
        assert norm.running_mean is not None and norm.running_var is not None
        scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)  # (outputs,)
        weight = conv.weight * scale[:, None, None, None]
        return weight, (conv.bias - norm.running_mean) * scale + norm.bias


class AudioEncoder(nn.Sequential):
    """SyncTalk's audio-visual encoder (AVE): (b, 1, 80, 16) mel windows to (b, 512), ≥ 0."""

    size = AVE_SIZE

    def __init__(self):
        """Builds the layers with random weights; keys are those of the published file."""
        super().__init__(
            ConvBlock(1, 32, 3, 1, 1),
            ConvBlock(32, 32, 3, 1, 1, residual=True),
            ConvBlock(32, 32, 3, 1, 1, residual=True),
            ConvBlock(32, 64, 3, (3, 1), 1),
            ConvBlock(64, 64, 3, 1, 1, residual=True),
            ConvBlock(64, 64, 3, 1, 1, residual=True),
            ConvBlock(64, 128, 3, 3, 1),
            ConvBlock(128, 128, 3, 1, 1, residual=True),
            ConvBlock(128, 128, 3, 1, 1, residual=True),
            ConvBlock(128, 256, 3, (3, 2), 1),
            ConvBlock(256, 256, 3, 1, 1, residual=True),
            ConvBlock(256, 512, 3, 1, 0),
            ConvBlock(512, 512, 1, 1, 0),
        )

    def forward(self, input: torch.Tensor) -> torch.Tensor:
        """(b, 1, 80, 16) to (b, 512)."""
        return super().forward(input).flatten(1)  # (b, 512)


class BuiltinEncoder(nn.Module):
    """The encoder that comes with the package: (b, 1, 80, 16) mel windows to (b, 64).

    No layer pads or strides in time, so that it also runs over a whole sound at once:
    (b, 1, 80, T) to (b, 64, T − 15), each column what its window gives.

    Attributes:
        blocks: Convolutions, 80 × 16 to 1 × 1.
        project: To the features, which have mean 0 and deviation 1 on the training sounds.
    """

    size = BUILTIN_SIZE

    def __init__(self, normalise: bool = False):
        """Builds it with random weights; only training needs batch normalisation."""
        super().__init__()
        self.blocks = nn.Sequential(
            ConvBlock(1, 32, (5, 3), (2, 1), (2, 0), normalise=normalise),  # 40 × 14
            ConvBlock(32, 48, 3, (2, 1), (1, 0), normalise=normalise),  # 20 × 12
            ConvBlock(48, 64, 3, (2, 1), (1, 0), (1, 2), normalise=normalise),  # 10 × 8
            ConvBlock(64, 96, 3, (2, 1), (1, 0), (1, 2), normalise=normalise),  # 5 × 4
            ConvBlock(96, 128, (5, 4), normalise=normalise),  # 1 × 1
            ConvBlock(128, 128, 1, residual=True, normalise=normalise),
        )
        self.project = nn.Conv2d(128, BUILTIN_SIZE, 1)

    def dense(self, mel: torch.Tensor) -> torch.Tensor:
        """(b, 1, 80, T) mel rows to (b, 64, T − 15): one column per first row of a window."""
        return self.project(self.blocks(mel)).squeeze(2)  # (b, 64, T − 15)

    def forward(self, mel: torch.Tensor) -> torch.Tensor:
        """(b, 1, 80, 16) to (b, 64)."""
        return self.dense(mel).squeeze(2)  # (b, 64)


class Adaptor(nn.Sequential):
    """Per-subject network from encoder features (…, D) to (…, 32), trained with the head."""

    def __init__(self, size: int):
        """Takes the encoder's feature size D."""
        super().__init__(
            nn.Linear(size, 256),
            nn.LeakyReLU(_SLOPE),
            nn.Linear(256, 128),
            nn.LeakyReLU(_SLOPE),
            nn.Linear(128, SPEECH_SIZE),
        )


class SequenceAdaptor(nn.Sequential):
    """The per-subject network for encoders with several vectors per row (HuBERT: 2), as SyncTalk's.

    Attributes:
        vectors: How many.
    """

    def __init__(self, size: int, vectors: int):
        """Takes the encoder's feature size D, all vectors of a row together, and their number."""
        super().__init__(
            nn.Conv1d(size // vectors, 32, 3, stride=2, padding=1),
            nn.LeakyReLU(_SLOPE),
            nn.Conv1d(32, 32, 3, stride=2, padding=1),
            nn.LeakyReLU(_SLOPE),
            nn.Conv1d(32, 64, 3, stride=2, padding=1),
            nn.LeakyReLU(_SLOPE),
            nn.Conv1d(64, 64, 3, stride=2, padding=1),
            nn.LeakyReLU(_SLOPE),
            nn.Flatten(),
            nn.Linear(64, 64),
            nn.LeakyReLU(_SLOPE),
            nn.Linear(64, SPEECH_SIZE),
        )
        self.vectors = vectors

    def forward(self, input: torch.Tensor) -> torch.Tensor:
        """Rows (…, D), one vector after the other, to (…, 32)."""
        rows = input.reshape(-1, self.vectors, input.shape[-1] // self.vectors)  # (n, v, D / v)
        return super().forward(rows.transpose(1, 2)).unflatten(0, input.shape[:-1])


class AudioAttNet(nn.Module):
    """Smooths over time: a learnt weighted mean of the eight rows around each.

    Attributes:
        convolutions: 32 → 16 → 8 → 4 → 2 → 1 channels over the window's rows.
        scores: One score per row; their softmax are the weights.
    """

    def __init__(self):
        """Builds it with random weights."""
        super().__init__()
        channels = (SPEECH_SIZE, 16, 8, 4, 2, 1)
        layers: list[nn.Module] = []
        for inputs, outputs in itertools.pairwise(channels):
            layers += [nn.Conv1d(inputs, outputs, 3, padding=1), nn.LeakyReLU(_SLOPE)]
        self.convolutions = nn.Sequential(*layers)
        self.scores = nn.Linear(ATTENTION_WINDOW, ATTENTION_WINDOW)

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """(b, 8, 32) to (b, 32)."""
        scores = self.convolutions(windows.transpose(1, 2)).squeeze(1)  # (b, 8)
        weights = torch.softmax(self.scores(scores), dim=1)  # (b, 8)
        return (weights[:, :, None] * windows).sum(1)  # (b, 32)


class SpeechAdaptor(nn.Module):
    """What is learnt per subject: adaptor and attention; D features to 32 expression values.

    Train it jointly with the head; row i of features and expressions is at i/25 s.

    Attributes:
        size: D.
        vectors: Vectors of a row, of D / vectors values each.
        adaptor: Applied to each row.
        attention: Applied to rows [i − 4, i + 4) of the adapted features.
    """

    def __init__(self, size: int, vectors: int = 1):
        """Takes the encoder's feature size D, and how many vectors a row has."""
        super().__init__()
        self.size, self.vectors = size, vectors
        self.adaptor = Adaptor(size) if vectors == 1 else SequenceAdaptor(size, vectors)
        self.attention = AudioAttNet()

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """Feature windows (b, 8, D), rows [i − 4, i + 4), to expressions (b, 32)."""
        return self.attention(self.adaptor(windows))

    def track(self, features: torch.Tensor) -> torch.Tensor:
        """Features of a whole sound (T, D) to its expressions (T, 32)."""
        adapted = self.adaptor(_padded(features))  # (T + 7, 32)
        windows = adapted.unfold(0, ATTENTION_WINDOW, 1).transpose(1, 2)  # (T, 8, 32)
        return self.attention(windows)


def feature_windows(features: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
    """The windows that `SpeechAdaptor` takes.

    Args:
        features: (T, D) of a whole sound.
        rows: (b,) row numbers in 0 … T − 1.

    Returns:
        (b, 8, D): rows [i − 4, i + 4), zeros outside the sound.
    """
    offsets = torch.arange(ATTENTION_WINDOW, device=rows.device)  # (8,)
    return _padded(features)[rows[:, None] + offsets]


def _padded(features: torch.Tensor) -> torch.Tensor:
    """(T, D) to (T + 7, D) with zero rows around."""
    return functional.pad(features, (0, 0, BEFORE, AFTER))
