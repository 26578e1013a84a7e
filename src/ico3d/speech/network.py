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
CONTEXT = 2
"""Rows before and after a row from which `SpeechAdaptor.lips` reads."""

_SLOPE = 0.02  # of the leaky ReLUs
_HERE = 6.0
"""Score by which the attention begins at the row itself, which gets 98 % of the weight."""


class ConvBlock(nn.Module):
    """Convolution, batch normalisation, addition of the input if residual, then ReLU.

    Attributes:
        conv_block: The convolution, followed by the batch normalisation unless both were merged.
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
        """Takes arguments of `nn.Conv2d`, then whether the block is residual and normalised."""
        super().__init__()
        conv = nn.Conv2d(inputs, outputs, kernel, stride, padding, dilation)
        layers = [conv, nn.BatchNorm2d(outputs)] if normalise else [conv]
        self.conv_block = nn.Sequential(*layers)
        self.residual = residual

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Maps (b, inputs, h, w) to (b, outputs, h', w')."""
        y = self.conv_block(x)
        return torch.relu(y + x if self.residual else y)

    def folded(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Weight and bias of one convolution that equals the block without its final ReLU."""
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
    """SyncTalk's audio-visual encoder (AVE): mel windows (b, 1, 80, 16) to (b, 512), at least 0."""

    size = AVE_SIZE

    def __init__(self):
        """Builds the layers with random weights; parameters are named as in the published file."""
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
        """Maps mel windows (b, 1, 80, 16) to features (b, 512)."""
        return super().forward(input).flatten(1)  # (b, 512)


class BuiltinEncoder(nn.Module):
    """The encoder that is part of ico3d: mel windows (b, 1, 80, 16) to features (b, 64).

    No layer pads or strides in time, so the encoder can also process a whole sound at once: `dense`
    maps (b, 1, 80, T) to (b, 64, T − 15), where each column equals the features of its window.

    Attributes:
        blocks: Convolutions that reduce 80 × 16 to 1 × 1.
        project: Linear layer to the features, which have mean 0 and deviation 1 on training sounds.
    """

    size = BUILTIN_SIZE

    def __init__(self, normalise: bool = False):
        """Builds the layers with random weights; batch normalisation is for training only."""
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
        """Mel rows (b, 1, 80, T) to features (b, 64, T − 15), one column per window."""
        return self.project(self.blocks(mel)).squeeze(2)  # (b, 64, T − 15)

    def forward(self, mel: torch.Tensor) -> torch.Tensor:
        """Maps mel windows (b, 1, 80, 16) to features (b, 64)."""
        return self.dense(mel).squeeze(2)  # (b, 64)


class Adaptor(nn.Sequential):
    """Network from encoder features (…, D) to (…, 32), trained with each person's head."""

    def __init__(self, size: int):
        """Takes D, the encoder's number of features per row."""
        super().__init__(
            nn.Linear(size, 256),
            nn.LeakyReLU(_SLOPE),
            nn.Linear(256, 128),
            nn.LeakyReLU(_SLOPE),
            nn.Linear(128, SPEECH_SIZE),
        )


class SequenceAdaptor(nn.Sequential):
    """Like `Adaptor`, for encoders with several vectors per row (HuBERT: 2), as in SyncTalk.

    Attributes:
        vectors: Number of vectors per row.
    """

    def __init__(self, size: int, vectors: int):
        """Takes D, the features per row, and the number of vectors that D is made of."""
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
        """Rows (…, D), in which the vectors are concatenated, to (…, 32)."""
        rows = input.reshape(-1, self.vectors, input.shape[-1] // self.vectors)  # (n, v, D / v)
        return super().forward(rows.transpose(1, 2)).unflatten(0, input.shape[:-1])


class AudioAttNet(nn.Module):
    """Smooths features over time: a learnt weighted mean of eight neighbouring rows.

    Attributes:
        convolutions: 32 → 16 → 8 → 4 → 2 → 1 channels, along the rows.
        scores: One score per row; the softmax of the scores gives the weights.
    """

    def __init__(self):
        """Builds the layers with random weights, and attends to the row itself at first.

        An even attention would be the mean of 0.32 s, in which strokes of the lips drown, and whose
        middle lies 20 ms in the past.
        """
        super().__init__()
        channels = (SPEECH_SIZE, 16, 8, 4, 2, 1)
        layers: list[nn.Module] = []
        for inputs, outputs in itertools.pairwise(channels):
            layers += [nn.Conv1d(inputs, outputs, 3, padding=1), nn.LeakyReLU(_SLOPE)]
        self.convolutions = nn.Sequential(*layers)
        self.scores = nn.Linear(ATTENTION_WINDOW, ATTENTION_WINDOW)
        with torch.no_grad():
            self.scores.bias[BEFORE] += _HERE

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """Maps windows of rows (b, 8, 32) to rows (b, 32)."""
        scores = self.convolutions(windows.transpose(1, 2)).squeeze(1)  # (b, 8)
        weights = torch.softmax(self.scores(scores), dim=1)  # (b, 8)
        return (weights[:, :, None] * windows).sum(1)  # (b, 32)


class SpeechAdaptor(nn.Module):
    """The speech part of a person's head: D encoder features to 32 expression values.

    The network is an adaptor followed by an attention, as in SyncTalk, and is trained together with
    the head. A linear reading of the person's lips is added (`lip_reading`), which does not change
    during that training. Row i of features and expressions belongs to time i/25 s.

    Attributes:
        size: D, features per row.
        vectors: Number of vectors per row, with D / vectors values each.
        adaptor: Applied to each row.
        attention: Applied to rows [i − 4, i + 4) of the adapted features.
        lips: (32, 5 · D) weights of rows i − 2 to i + 2 of the features; 0 where nothing was read.
        lips_rest: (32,) what is added to that.
    """

    lips: torch.Tensor
    lips_rest: torch.Tensor

    def __init__(self, size: int, vectors: int = 1):
        """Takes D, the features per row, and the number of vectors that D is made of."""
        super().__init__()
        self.size, self.vectors = size, vectors
        self.adaptor = Adaptor(size) if vectors == 1 else SequenceAdaptor(size, vectors)
        self.attention = AudioAttNet()
        self.register_buffer("lips", torch.zeros(SPEECH_SIZE, (2 * CONTEXT + 1) * size))
        self.register_buffer("lips_rest", torch.zeros(SPEECH_SIZE))

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """Windows (b, 8, D) of feature rows i − 4 to i + 3 to expression values (b, 32)."""
        return self.attention(self.adaptor(windows)) + self._lips(windows)

    def track(self, features: torch.Tensor) -> torch.Tensor:
        """Features of a whole sound (T, D) to expression values (T, 32)."""
        padded = _padded(features)  # (T + 7, D)
        windows = padded.unfold(0, ATTENTION_WINDOW, 1).transpose(1, 2)  # (T, 8, D)
        adapted = self.adaptor(padded).unfold(0, ATTENTION_WINDOW, 1).transpose(1, 2)  # (T, 8, 32)
        return self.attention(adapted) + self._lips(windows)

    def restore(self, state: dict[str, torch.Tensor]) -> None:
        """Takes over what `state_dict` returned; earlier versions read no lips.

        Raises:
            RuntimeError: If the state is that of another network.
        """
        nothing = {name: torch.zeros_like(value) for name, value in self.named_buffers()}
        self.load_state_dict(nothing | state)

    def _lips(self, windows: torch.Tensor) -> torch.Tensor:
        """What windows (b, 8, D) tell about the lips: (b, 32)."""
        near = windows[:, BEFORE - CONTEXT : BEFORE + CONTEXT + 1]  # (b, 5, D)
        return near.flatten(1) @ self.lips.T + self.lips_rest


def feature_windows(features: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
    """Cuts the windows that `SpeechAdaptor` takes out of a sound's features.

    Args:
        features: (T, D) features of a whole sound.
        rows: (b,) row numbers i, 0 to T − 1.

    Returns:
        (b, 8, D): rows i − 4 to i + 3; rows outside the sound are 0.
    """
    offsets = torch.arange(ATTENTION_WINDOW, device=rows.device)  # (8,)
    return _padded(features)[rows[:, None] + offsets]


def _padded(features: torch.Tensor) -> torch.Tensor:
    """(T, D) to (T + 7, D) with zero rows around."""
    return functional.pad(features, (0, 0, BEFORE, AFTER))
