"""OpenVoice V2 and MeloTTS as their documentation and demo show them, without their weights."""

import hashlib
import importlib.machinery
import sys
import types
from pathlib import Path

import numpy as np
import soundfile
import torch

BASE_RATE, CONVERTED_RATE = 44100, 22050
SECONDS_PER_LETTER = 0.05


class HParams(types.SimpleNamespace):
    """Their settings object: attributes, and a mapping's methods."""

    def keys(self):
        return vars(self).keys()

    def items(self):
        return vars(self).items()

    def __getitem__(self, key):
        return getattr(self, key)


SPEAKERS = {
    "EN": {"EN-US": 0, "EN-BR": 1, "EN_INDIA": 2, "EN-AU": 3, "EN-Default": 4},
    **{code: {code: 0} for code in ("ES", "FR", "ZH", "JP", "KR")},
}


class TTS:
    """`melo.api.TTS`: says a tone as long as the text."""

    made: list["TTS"] = []  # noqa: RUF012

    def __init__(self, language, device="auto", use_hf=True, config_path=None, ckpt_path=None):
        assert Path(config_path).is_file() and Path(ckpt_path).is_file()  # else it would download
        self.language, self.device = language, "cpu" if device == "auto" else device
        speakers = HParams(**SPEAKERS[language])
        self.hps = HParams(data=HParams(spk2id=speakers, sampling_rate=BASE_RATE))
        self.said = []
        TTS.made.append(self)

    def tts_to_file(
        self,
        text,
        speaker_id,
        output_path=None,
        sdp_ratio=0.2,
        noise_scale=0.6,
        noise_scale_w=0.8,
        speed=1.0,
        pbar=None,
        format=None,
        position=None,
        quiet=False,
    ):
        assert output_path is None
        self.said.append((text, speaker_id))
        samples = int(BASE_RATE * SECONDS_PER_LETTER * len(text) / speed)
        tone = 0.5 * np.sin(2 * np.pi * 200 * np.arange(samples) / BASE_RATE)
        return tone.astype(np.float32)


class OpenVoiceBaseClass:
    """Takes no wish for a watermark, whatever its subclass does with it."""

    def __init__(self, config_path, device="cuda:0"):
        assert "cuda" not in device and Path(config_path).is_file()
        self.device, self.loaded = device, None
        self.hps = HParams(data=HParams(sampling_rate=CONVERTED_RATE))

    def load_ckpt(self, ckpt_path):
        self.loaded = Path(ckpt_path).read_bytes()


class ToneColorConverter(OpenVoiceBaseClass):
    """`openvoice.api.ToneColorConverter`: louder or quieter by the embeddings it is given."""

    made: list["ToneColorConverter"] = []  # noqa: RUF012

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.watermark_model = object() if kwargs.get("enable_watermark", True) else None
        self.extracted, self.messages = 0, []
        ToneColorConverter.made.append(self)

    def extract_se(self, ref_wav_list, se_save_path=None):
        self.extracted += 1
        [path] = ref_wav_list
        level = hashlib.sha256(Path(path).read_bytes()).digest()[0] / 512 + 0.25
        return torch.full((1, 256, 1), level)

    def convert(self, audio_src_path, src_se, tgt_se, output_path=None, tau=0.3, message="default"):
        assert output_path is None and src_se.shape == tgt_se.shape == (1, 256, 1)
        samples, rate = soundfile.read(audio_src_path, dtype="float32")
        assert rate == BASE_RATE and self.loaded
        self.messages.append(message if self.watermark_model else None)
        return samples[:: BASE_RATE // CONVERTED_RATE] * float(tgt_se[0, 0, 0] / src_se[0, 0, 0])


def install(monkeypatch):
    """Puts them where Python looks for what is installed."""
    TTS.made, ToneColorConverter.made = [], []
    for package, kind in (("melo", TTS), ("openvoice", ToneColorConverter)):
        for name in (package, f"{package}.api"):
            module = types.ModuleType(name)
            module.__spec__ = importlib.machinery.ModuleSpec(name, None)
            setattr(module, kind.__name__, kind)
            monkeypatch.setitem(sys.modules, name, module)


PARTS = ("English", "Spanish", "French", "Chinese", "Japanese", "Korean")


HELD = b"pretended"
"""A word in each file of weights."""


def write_weights(folder):
    """The files that the adapter looks for; only the speakers' embeddings are real."""
    for part in ("OpenVoiceV2/converter", *(f"MeloTTS-{language}" for language in PARTS)):
        (folder / part).mkdir(parents=True)
        (folder / part / "config.json").write_text("{}")
        torch.save({HELD.decode(): 1}, folder / part / "checkpoint.pth")
    embeddings = folder / "OpenVoiceV2" / "base_speakers" / "ses"
    embeddings.mkdir(parents=True)
    for speaker in ("en-us", "en-india", "es", "fr", "zh", "jp", "kr"):
        torch.save(torch.full((1, 256, 1), 0.5), embeddings / f"{speaker}.pth")
