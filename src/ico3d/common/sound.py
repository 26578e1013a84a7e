"""What a sound says of itself, judged before it is decoded or resampled.

A header of 44 bytes may claim any rate and any length: two kilobytes at 1 Hz are half an hour of
sound, and 100 MB of samples. Every entrance of sound asks `fault` first.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# (soundfile is untyped)

import struct
import wave
from dataclasses import dataclass
from pathlib import Path

LOWEST_RATE, HIGHEST_RATE = 4_000, 384_000  # samples per second
MOST_CHANNELS = 64
MOST_BYTES = 2 << 30  # of decoded samples
RECORDING = 2 * 3600.0  # s of a recording that someone made on purpose
REQUEST = 600.0  # s of a sound that another machine sends, or of one that it is asked for
WAV_ERRORS = (wave.Error, EOFError, RuntimeError)
"""What `wave` raises for damaged files: the last where one part claims more than another holds."""
_WAV = struct.Struct("<4s4x4s4s4xHHI6xH")  # up to the width of a sample, of a plain WAV file


@dataclass(frozen=True)
class Claim:
    """What a header says.

    Attributes:
        rate: Samples per second.
        channels: How many.
        frames: Samples of each channel.
        width: Bytes of a decoded sample.
    """

    rate: int
    channels: int = 1
    frames: int = 0
    width: int = 4


def fault(claim: Claim, longest: float = RECORDING) -> str:
    """Why a sound is not taken, as a clause without its subject; empty if it is.

    Args:
        claim: What it says of itself.
        longest: Seconds that it may last.
    """
    if not LOWEST_RATE <= claim.rate <= HIGHEST_RATE:
        return f"claims {claim.rate} samples per second, not {LOWEST_RATE} to {HIGHEST_RATE}"
    if not 1 <= claim.channels <= MOST_CHANNELS:
        return f"claims {claim.channels} channels, not 1 to {MOST_CHANNELS}"
    if claim.frames > longest * claim.rate:
        return f"is longer than {longest:g} s"
    if claim.frames * claim.channels * claim.width > MOST_BYTES:
        return f"has more than {MOST_BYTES >> 30} GiB of samples"
    return ""


def file_claim(path: Path) -> Claim:
    """What the header of a file says, of any kind that libsndfile reads; needs soundfile.

    Raises:
        OSError, RuntimeError: If it cannot be read as sound.
    """
    import soundfile

    info = soundfile.info(str(path))
    return Claim(info.samplerate, info.channels, info.frames)


def open_claim(sound: wave.Wave_read, size: int) -> Claim:
    """What an opened WAV file says; one written while it was made claims more than there is.

    Args:
        sound: The file.
        size: Its bytes.
    """
    width, channels = sound.getsampwidth(), sound.getnchannels()
    frames = min(sound.getnframes(), size // (width * channels))
    return Claim(sound.getframerate(), channels, frames, width)


def wav_claim(head: bytes) -> Claim | None:
    """What the first 44 bytes of a plain WAV file say, its length aside; None for other bytes."""
    if len(head) < _WAV.size:
        return None
    riff, wave, form, _, channels, rate, bits = _WAV.unpack_from(head)
    if (riff, wave, form) != (b"RIFF", b"WAVE", b"fmt "):
        return None
    return Claim(rate, channels, width=bits // 8)
