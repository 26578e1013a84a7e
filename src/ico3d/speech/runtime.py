"""Sound to expression values where an avatar is served: numpy and onnxruntime, no torch."""

from pathlib import Path
from typing import Any

import numpy as np

from ico3d.common.expression import SPEECH_SIZE
from ico3d.errors import MissingExtraError, ModelError
from ico3d.speech.mel import mel_windows
from ico3d.speech.stream import WindowStream

BEFORE, AFTER = 4, 3  # rows that the attention sees around each: [i − 4, i + 4)


class SpeechModel:
    """The `speech.onnx` of a bundle (docs/bundle.md)."""

    def __init__(self, model: bytes | Path | str, encoder: bytes | Path | str | None = None):
        """Opens a model.

        Args:
            model: `speech.onnx` or its bytes.
            encoder: Encoder from mel windows to features (`export_encoder` writes it), needed
                where the model's input is `features`.

        Raises:
            MissingExtraError: If onnxruntime is not installed.
            ModelError: If a file is no such model, or the encoder is missing or does not fit.
        """
        self._model = _session(model, "speech.onnx")
        self._input = self._model.get_inputs()[0].name
        if self._input not in ("mel", "features"):
            raise ModelError(f"speech.onnx has the unknown input '{self._input}'.")
        self._encoder = None
        if self._input == "features":
            if encoder is None:
                raise ModelError(
                    "this avatar's speech encoder is not in the bundle: name the encoder's file."
                )
            self._encoder = _session(encoder, "the speech encoder")
            size, wanted = self._encoder.get_outputs()[0].shape[1], self._width()
            if size != wanted:
                raise ModelError(
                    f"the speech encoder gives {size} features, this avatar needs {wanted}."
                )

    def expressions(self, samples: np.ndarray, rate: int) -> np.ndarray:
        """Expression values of a whole sound.

        Args:
            samples: (S,) in [-1, 1].
            rate: Samples per second.

        Returns:
            (T, 32) float32; row i belongs to time i/25 s, T ≥ ⌊25·seconds⌋ + 1.
        """
        return self.run(mel_windows(samples, rate))

    def run(self, windows: np.ndarray) -> np.ndarray:
        """Mel windows (T, 80, 16) of a whole sound to its expressions (T, 32)."""
        inputs = windows
        if self._encoder is not None:
            inputs = self._encoder.run(None, {"mel": windows})[0]  # (T, D)
        return self._model.run(None, {self._input: inputs})[0]

    def _width(self) -> int:
        """D, the number of features that the model takes."""
        return self._model.get_inputs()[0].shape[1]


class StreamingExpressions:
    """Expression values of a sound that arrives in pieces.

    The rows are those of `SpeechModel.expressions` on the whole sound; row i comes as soon as the
    sound is there that it depends on, until about (i/25 + 0.26) s.
    """

    def __init__(self, model: SpeechModel, rate: int):
        """Starts one sound.

        Args:
            model: What turns it into expressions.
            rate: Samples per second of the pieces.
        """
        self._run = model.run
        self._stream = WindowStream(rate)
        self._windows = np.zeros((0, 80, 16), np.float32)  # from row `_first` on
        self._first = 0
        self._next = 0  # the row that is returned next

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Takes the next samples (S,); returns the rows (n, 32) that are now known."""
        return self._advance(self._stream.push(samples), AFTER)

    def finish(self) -> np.ndarray:
        """Ends the sound; returns the remaining rows (n, 32)."""
        return self._advance(self._stream.finish(), 0)

    def _advance(self, windows: np.ndarray, held_back: int) -> np.ndarray:
        """Adds windows; runs the rows that need none of those still to come."""
        self._windows = np.concatenate([self._windows, windows])
        ready = self._first + len(self._windows) - held_back
        if ready <= self._next:
            return np.zeros((0, SPEECH_SIZE), np.float32)
        rows = self._run(self._windows)[self._next - self._first : ready - self._first]
        self._next = ready
        keep = max(0, ready - BEFORE)  # rows before it are zero for the graph, so keep context
        self._windows = self._windows[keep - self._first :]
        self._first = keep
        return rows


def _session(model: bytes | Path | str, what: str) -> Any:
    """An onnxruntime session on one CPU thread: a row takes less than a hand-over to others."""
    try:
        import onnxruntime
    except ImportError:
        raise MissingExtraError("onnxruntime", "chat", "speech-driven expressions") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 3
    source = model if isinstance(model, bytes) else str(model)
    try:
        return onnxruntime.InferenceSession(source, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise ModelError(f"{what} is no usable ONNX model: {error}") from None
