"""Piper through pipecat's own service: small voices for some forty languages, on the CPU.

The package piper-tts is licensed under GPL-3.0; it is an optional extra, loaded at run time.
"""

import functools
import json
import os
from collections import deque
from collections.abc import AsyncGenerator, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipecat.audio.utils import create_stream_resampler
from pipecat.frames.frames import Frame, TTSAudioRawFrame
from pipecat.services.tts_service import TTSService

from ico3d.chat.frames import PhonemesFrame
from ico3d.chat.services.provider import Context, lacks_package
from ico3d.chat.services.voice.base import LOADING, OPTIONS, SYNCHRONOUS, Prompt
from ico3d.chat.services.voice.phonemes import timed
from ico3d.chat.services.voice.portions import portions
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.common.espeak.phonemes import of_piper
from ico3d.common.espeak.speech import Phoneme
from ico3d.common.weights import model_folders
from ico3d.errors import MissingExtraError, MissingModelError, SettingsError


@dataclass(frozen=True)
class Settings:
    """Options of the voice `piper`.

    Attributes:
        voice: Name of the voice, such as `en_US-ljspeech-high` or `de_DE-thorsten-medium`; each
            voice has a licence of its own.
        cuda: Run on an NVIDIA GPU; needs onnxruntime-gpu.
    """

    voice: str = "en_US-ljspeech-high"
    cuda: bool = False


def find_voice(settings: Settings) -> Path:
    """Path of the voice's model; the description lies beside it.

    Raises:
        MissingModelError: If the voice is not installed.
    """
    if Path(settings.voice).name != settings.voice:
        raise MissingModelError(f"the Piper voice '{settings.voice}' is no name of a voice.")
    names = f"{settings.voice}.onnx", f"{settings.voice}.onnx.json"
    places = [place for folder in model_folders() for place in (folder, folder / settings.voice)]
    for place in places:
        if all(os.path.isfile(place / name) for name in names):
            return place / names[0]
    fetch = f"python -m piper.download_voices --download-dir {model_folders()[-1]}"
    raise MissingModelError(
        f"the Piper voice '{settings.voice}' is not here: fetch it with {fetch} {settings.voice}."
    )


def hindrance(settings: Settings) -> str:
    """A sentence on a missing package or missing files; empty if Piper works."""
    try:
        find_voice(settings)
    except MissingModelError as error:
        return lacks_package("piper", "piper") or str(error)
    return lacks_package("piper", "piper")


def make(settings: Settings, context: Context) -> TTSService:
    """Creates the voice of one session; all sessions share one model.

    Raises:
        MissingExtraError: If piper-tts is not installed.
        MissingModelError: If the voice's files are not installed.
        SettingsError: If the voice would need further downloads.
    """
    try:
        from pipecat.services.piper.tts import PiperTTSService
    except ImportError:
        raise MissingExtraError("piper-tts", "piper", "the Piper voice") from None

    class PiperVoice(Prompt, PiperTTSService):
        """pipecat's, with a model that is there: its own constructor loads or downloads one."""

        def __init__(self, model: Any):
            own = PiperTTSService.Settings(model=None, voice=settings.voice, language=None)
            TTSService.__init__(self, settings=own, **SYNCHRONOUS, **OPTIONS)
            self._voice = self._model = model
            # its own forgets the sound before a pause of 0.2 s, which a slow machine makes
            self._resampler = create_stream_resampler(clear_after_secs=None)

        async def run_tts(self, text: str, context_id: str) -> AsyncGenerator[Frame, None]:
            """Yields speech sounds and sound, also the 20 ms that a resampler would keep."""
            for portion in portions(text):
                await self._resampler.reset()  # the piece before may have been interrupted
                telling: Any = Telling(self._model)  # one each: one before may be on its way
                self._voice = telling
                async for frame in super().run_tts(portion, context_id):
                    while telling.told:
                        phonemes, seconds = telling.told.popleft()
                        yield PhonemesFrame(phonemes, seconds, context_id)
                    yield frame
                if rest := await self._resampler.flush():
                    yield TTSAudioRawFrame(rest, SPEECH_RATE, 1, context_id=context_id)

    with LOADING:
        return PiperVoice(engine(find_voice(settings), settings.cuda))


@functools.cache
def engine(model: Path, cuda: bool) -> Any:
    """Loads the model, once per process.

    Raises:
        SettingsError: If the voice would need further downloads.
    """
    from piper import PiperVoice

    if json.loads(Path(f"{model}.json").read_bytes()).get("phoneme_type") == "pinyin":
        raise SettingsError(
            f"{model}: Piper's Chinese voices would download a dictionary in mid-talk: "
            "use kokoro or openvoice."
        )
    aligned = find_spec("onnx") is not None  # with which Piper finds the durations in its model
    voice = PiperVoice.load(model, use_cuda=cuda, include_alignments=aligned)
    voice.phonemize = functools.partial(of_piper, Path(f"{model}.json"))
    return voice


class Telling:
    """A Piper voice that keeps the speech sounds of what it speaks.

    Attributes:
        config: The voice's own configuration.
        told: Speech sounds and seconds of each sentence that nobody has taken yet.
    """

    def __init__(self, voice: Any):
        """Wraps a `piper.PiperVoice`."""
        self._voice, self.config = voice, voice.config
        self.told: deque[tuple[tuple[Phoneme, ...], float]] = deque()

    def synthesize(self, text: str) -> Iterator[Any]:
        """Yields Piper's sentences."""
        for sentence in self._voice.synthesize(text, include_alignments=True):
            rate = sentence.sample_rate
            lengths = sentence.phoneme_alignments or ()
            if phonemes := timed((a.phoneme, float(a.num_samples) / rate) for a in lengths):
                self.told.append((phonemes, len(sentence.audio_float_array) / rate))
            yield sentence
