"""From sound to expression values on a server: numpy and onnxruntime, no torch."""

import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from threading import Timer
from typing import Any, Protocol

import numpy as np

from ico3d.common.catalogue.table import TABLE
from ico3d.common.espeak.speech import Phoneme
from ico3d.common.expression import SPEECH_SIZE
from ico3d.common.weights import find_model, model_folders
from ico3d.errors import MissingExtraError, MissingModelError, ModelError
from ico3d.speech.blocks import BlockStream
from ico3d.speech.mel import FPS, RATE
from ico3d.speech.phonemes import TimedPhonemes
from ico3d.speech.silence import SilenceGate
from ico3d.speech.stream import WindowStream

_LARGE = 10**8  # bytes
MOST_MEMORY = 1 << 30  # bytes that the graphs of bundles may take while they run, all together
MOST_SECONDS = 5.0  # that a run of a bundle's graph may take longer than its sound lasts
AT_ONCE = 30.0  # s of a whole sound, whose rows are computed together

SILENT = 4  # severity; what onnxruntime says beside its errors quotes the names of a file
BEFORE, AFTER = 4, 3  # rows that the attention sees around each: [i − 4, i + 4)
TOLD = "told"
"""Input of a graph for what is known of the lips' articulation; not all graphs have it."""


class RowStream(Protocol):
    """Turns pieces of a sound into rows of a network's input."""

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples (S,) in [-1, 1]; returns the rows that are now complete."""
        ...

    def finish(self) -> np.ndarray:
        """Ends the sound; returns the remaining rows."""
        ...


class SpeechModel:
    """The `speech.onnx` of a bundle (docs/bundle.md), together with its encoder."""

    def __init__(self, model: bytes | Path | str, encoder: bytes | Path | str | None = None):
        """Opens the model and, where needed, the encoder.

        Args:
            model: Path or contents of `speech.onnx`.
            encoder: Path or contents of an encoder that `export_encoder` wrote, from mel windows or
                sound to features; needed if the model's input is `features`.

        Raises:
            MissingExtraError: If onnxruntime is not installed.
            ModelError: If a file cannot be used or takes more than `MOST_MEMORY`, or the encoder is
                missing or has another feature size.
        """
        self._model = _session(model, "speech.onnx", bounded=True)
        self._input = self._model.get_inputs()[0].name
        if self._input not in ("mel", "features"):
            raise ModelError(f"speech.onnx has the unknown input '{self._input}'.")
        self._encoder = None
        if self._input == "features":
            if encoder is None:
                raise ModelError(
                    "this avatar's speech encoder is not in the bundle: name the encoder's file."
                )
            self._encoder = _Encoder(encoder)
            size, wanted = self._encoder.size, self._model.get_inputs()[0].shape[1]
            if size != wanted:
                raise ModelError(
                    f"the speech encoder gives {size} features, this avatar needs {wanted}."
                )
        self.takes_phonemes = TOLD in [i.name for i in self._model.get_overridable_initializers()]
        self.silent_input = self._silence()
        silent = np.repeat(self.silent_input[None], BEFORE + 1 + AFTER, axis=0)
        self.silent_expression = self._tried(silent)[BEFORE]  # (32,)

    def expressions(self, samples: np.ndarray, rate: int) -> np.ndarray:
        """Expression values of a whole sound; silence is assumed before and after.

        Args:
            samples: (S,) in [-1, 1].
            rate: Samples per second.

        Returns:
            (T, 32) float32; row i belongs to time i/25 s, T ≥ ⌊25·seconds⌋ + 1.
        """
        stream = StreamingExpressions(self, rate)
        size = round(AT_ONCE * rate)
        pieces = (samples[at : at + size] for at in range(0, len(samples), size))
        return np.concatenate([*map(stream.push, pieces), stream.finish()])

    def stream(self, rate: int) -> RowStream:
        """A stream that turns a new sound of `rate` samples per second into rows for `run`."""
        return WindowStream(rate) if self._encoder is None else self._encoder.stream(rate)

    def run(self, rows: np.ndarray, told: np.ndarray | None = None) -> np.ndarray:
        """Mel windows (T, 80, 16) or features (T, D) to expression values (T, 32).

        Args:
            rows: What is heard.
            told: (T, 6) what is known of the articulation (`TimedPhonemes.rows`); None for nothing.

        Raises:
            ModelError: If the graph cannot be run, or takes too long or too much memory.
        """
        given = {self._input: rows}
        if told is not None and self.takes_phonemes:
            given[TOLD] = told
        try:
            return _within(MOST_SECONDS + len(rows) / FPS, self._model, given)
        except Exception as error:  # onnxruntime's have no common class
            why = str(error).strip().rstrip(".")[:200]
            raise ModelError(
                f"speech.onnx cannot be run within {MOST_MEMORY >> 20} MiB "
                f"and {MOST_SECONDS:g} s: {why}."
            ) from None

    def _tried(self, rows: np.ndarray) -> np.ndarray:
        """The first run, which shows whether a stranger's graph can be run at all."""
        found = self.run(rows)
        if found.shape != (len(rows), SPEECH_SIZE):
            raise ModelError(f"speech.onnx gives {found.shape[-1]} values, not {SPEECH_SIZE}.")
        return found

    def _silence(self) -> np.ndarray:
        """The row that is amid long silence."""
        stream = self.stream(RATE)
        rows = np.concatenate([stream.push(np.zeros(2 * RATE, np.float32)), stream.finish()])
        return rows[len(rows) // 2]


class _Encoder:
    """An encoder that lies outside of the bundle."""

    def __init__(self, file: bytes | Path | str):
        self._session = _session(file, "the speech encoder", heavy=_is_large(file))
        self.input = self._session.get_inputs()[0].name
        if self.input not in ("mel", "sound"):
            raise ModelError(f"the speech encoder has the unknown input '{self.input}'.")
        self.size: int = self._session.get_outputs()[0].shape[1]

    def stream(self, rate: int) -> RowStream:
        """Turns a new sound into features (n, D)."""
        if self.input == "sound":
            return _BlockFeatures(self.run, rate, self.size)
        return _WindowFeatures(self.run, rate)

    def run(self, inputs: np.ndarray) -> np.ndarray:
        """Mel windows (n, 80, 16), or one window of sound (1, S), to features (n', D)."""
        return self._session.run(None, {self.input: inputs})[0]


class _WindowFeatures:
    """Features of encoders that look at mel windows."""

    def __init__(self, run: Callable[[np.ndarray], np.ndarray], rate: int):
        self._run, self._windows = run, WindowStream(rate)

    def push(self, samples: np.ndarray) -> np.ndarray:
        """(n, D) that are now known."""
        return self._run(self._windows.push(samples))

    def finish(self) -> np.ndarray:
        """The remaining (n, D)."""
        return self._run(self._windows.finish())


class _BlockFeatures:
    """Features of encoders that look at the sound itself."""

    def __init__(self, run: Callable[[np.ndarray], np.ndarray], rate: int, size: int):
        self._run, self._blocks, self._size = run, BlockStream(rate), size
        self._given = 0

    def push(self, samples: np.ndarray) -> np.ndarray:
        """(n, D) that are now known."""
        return self._features(self._blocks.push(samples))

    def finish(self) -> np.ndarray:
        """The remaining (n, D): the last window may reach beyond the sound."""
        rows = self._features(self._blocks.finish())
        return rows[: len(rows) - self._given + self._blocks.num_rows]

    def _features(self, windows: np.ndarray) -> np.ndarray:
        rows = [self._run(window[None]) for window in windows]
        self._given += sum(map(len, rows))
        return np.concatenate([np.zeros((0, self._size), np.float32), *rows])


class StreamingExpressions:
    """Expression values of a sound that arrives in pieces.

    The rows equal those of `SpeechModel.expressions` for the whole sound. Row i is returned as soon
    as the sound that it depends on has arrived: up to about (i/25 + 0.26) s with encoders of mel
    windows, (i/25 + 0.53) s with encoders of the sound itself. Where the sound is silent (see
    `silence`), rows are those of a closed mouth.
    """

    def __init__(self, model: SpeechModel, rate: int):
        """Starts one sound.

        Args:
            model: The speech model of the avatar.
            rate: Samples per second of the pieces.
        """
        self._model = model
        self._stream = model.stream(rate)
        self._gate = SilenceGate(rate)
        self._phonemes = TimedPhonemes()
        self._rate, self._heard = rate, 0
        self._rows = self._silence(BEFORE)  # inputs of the graph from row `_next` − BEFORE on
        self._next = 0  # the row that is returned next

    def tell(self, phonemes: Sequence[Phoneme], seconds: float) -> None:
        """Says which phonemes the next seconds of sound hold, before the first of its samples.

        The mouth then follows them and the sound together, if the model can.
        """
        self._phonemes.add(phonemes, self._heard / self._rate, seconds)

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples (S,); returns the rows (n, 32) that are now known."""
        self._gate.push(samples)
        self._heard += len(samples)
        return self._advance(self._stream.push(samples))

    def finish(self) -> np.ndarray:
        """Ends the sound; returns the remaining rows (n, 32)."""
        self._gate.finish()
        return self._advance(np.concatenate([self._stream.finish(), self._silence(AFTER)]))

    def _silence(self, count: int) -> np.ndarray:
        """What surrounds the sound; the graph would take zeros, which sound like no silence."""
        return np.repeat(self._model.silent_input[None], count, axis=0)

    def _advance(self, inputs: np.ndarray) -> np.ndarray:
        """Adds inputs; runs the rows that need none of those still to come."""
        self._rows = np.concatenate([self._rows, inputs])
        ready = len(self._rows) - BEFORE - AFTER
        if ready <= 0:
            return np.zeros((0, SPEECH_SIZE), np.float32)
        told = self._phonemes.rows(self._next - BEFORE, len(self._rows))
        rows = self._model.run(self._rows, told)[BEFORE : BEFORE + ready]  # (ready, 32)
        gains = self._gate.gains(self._next, ready)[:, None]  # (ready, 1)
        self._rows = self._rows[ready:]
        self._next += ready
        silent = self._model.silent_expression
        return silent + gains * (rows - silent)


def open_speech(model: bytes, encoder: str, sha256: str, takes: str) -> SpeechModel:
    """Opens a bundle's speech model, with an encoder installed on this machine where needed.

    Args:
        model: Contents of `speech.onnx`.
        encoder: Name of the encoder.
        sha256: SHA-256 of the encoder's weights.
        takes: Input of the model: `mel` if the encoder is part of the model, else `features`.

    Raises:
        MissingModelError: If the encoder is neither part of the model nor installed.
        ModelError: If a model cannot be used.
    """
    if takes == "mel":
        return SpeechModel(model)
    weights = TABLE.get(encoder)
    if weights is not None and weights.notice:
        warnings.warn(weights.notice, stacklevel=2)
    return SpeechModel(model, served_encoder(encoder, sha256))


def served_encoder(name: str, sha256: str) -> Path:
    """Path of the exported encoder with these weights.

    Raises:
        MissingModelError: If the file is not on this machine; the sentence says how to make it.
    """
    file = served_name(name, sha256)
    found = find_model(file)
    if found is None:
        raise MissingModelError(
            f"this avatar listens with the speech encoder '{name}', which is not here as '{file}': "
            f"make it with ico3d weights onnx {name} where torch is installed, "
            f"and put it into {model_folders()[-1]}."
        )
    return found


def served_name(name: str, sha256: str) -> str:
    """File name of an exported encoder."""
    return f"{name}-{sha256[:12]}.onnx"


def _within(seconds: float, session: Any, given: dict[str, np.ndarray]) -> np.ndarray:
    """The first output of a run, which ends at the next operator when the time is over."""
    import onnxruntime

    options = onnxruntime.RunOptions()
    options.log_severity_level = SILENT
    timer = Timer(seconds, setattr, (options, "terminate", True))
    timer.daemon = True
    timer.start()
    try:
        found = session.run(None, given, options)[0]
    finally:
        timer.cancel()
    if options.terminate:
        raise TimeoutError(f"it took more than {seconds:g} s")
    return found


def _is_large(file: bytes | Path | str) -> bool:
    """Whether an encoder is of HuBERT's kind: hundreds of megabytes."""
    size = len(file) if isinstance(file, bytes) else Path(file).stat().st_size
    return size > _LARGE


def _session(
    model: bytes | Path | str, what: str, heavy: bool = False, bounded: bool = False
) -> Any:
    """An onnxruntime session.

    Args:
        model: The file or its bytes.
        what: What errors call it.
        heavy: Whether other threads or a GPU are worth a hand-over; a row of a light model takes
            less than that.
        bounded: Whether the file may be a stranger's, so that it gets no more than `MOST_MEMORY`:
            a graph of a few hundred bytes can double its data at each step.
    """
    try:
        import onnxruntime
    except ImportError:
        raise MissingExtraError("onnxruntime", "chat", "speech-driven expressions") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 0 if heavy else 1
    options.log_severity_level = SILENT
    # constants are folded while a file is opened, outside of the bound
    left_out = ["ConstantFolding"] if bounded else []
    if bounded:
        _bound_memory()
        options.add_session_config_entry("session.use_env_allocators", "1")
        # bytes that are ONNX and a format of onnxruntime at once are read as what was checked
        options.add_session_config_entry("session.load_model_format", "ONNX")
    source = model if isinstance(model, bytes) else str(model)
    wanted = ("CUDAExecutionProvider", "CPUExecutionProvider")[0 if heavy else 1 :]
    providers = [name for name in wanted if name in onnxruntime.get_available_providers()]
    try:
        return onnxruntime.InferenceSession(
            source, options, providers=providers, disabled_optimizers=left_out
        )
    except Exception as error:
        why = str(error).strip().rstrip(".")
        raise ModelError(f"{what} is no usable ONNX model: {why}.") from None


@cache
def _bound_memory() -> None:
    """Gives onnxruntime, once in a process, the bounded memory that sessions may ask for."""
    import onnxruntime

    as_asked = {"arena_extend_strategy": 1, "initial_chunk_size_bytes": -1}
    bounds = {"max_mem": MOST_MEMORY, **as_asked, "max_dead_bytes_per_chunk": -1}
    kind = onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR
    memory = onnxruntime.OrtMemoryInfo("Cpu", kind, 0, onnxruntime.OrtMemType.DEFAULT)
    onnxruntime.create_and_register_allocator(memory, onnxruntime.OrtArenaCfg(bounds))
