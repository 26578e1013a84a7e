"""Checks what the header of a sound file claims, before it is decoded or resampled; writes WAV.

A header of 44 bytes can claim any rate and length: a file of two kilobytes at 1 Hz claims half an
hour, which takes 100 MB once resampled. Code that accepts sound from outside calls `fault` first.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# (soundfile is untyped)

import io
import struct
import wave
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

LOWEST_RATE, HIGHEST_RATE = 4_000, 384_000  # samples per second
MOST_CHANNELS = 64
MOST_BYTES = 2 << 30  # of decoded samples
RECORDING = 2 * 3600.0  # s of a recording that someone made on purpose
REQUEST = 600.0  # s of a sound that another machine sends, or of one that it is asked for
MOST_CHUNKS = 64  # before the sound of a WAV file; other programs write fewer than ten
WAV_ERRORS = (wave.Error, EOFError, RuntimeError)
"""What `wave` raises for damaged files; RuntimeError where a chunk claims more than its parent."""
_WAV = struct.Struct("<4s4x4s4s4xHHI6xH")  # up to the width of a sample, of a plain WAV file


@dataclass(frozen=True)
class Claim:
    """What the header of a sound file claims.

    Attributes:
        rate: Samples per second.
        channels: Number of channels.
        frames: Samples of each channel.
        width: Bytes of one decoded sample of one channel.
    """

    rate: int
    channels: int = 1
    frames: int = 0
    width: int = 4


def fault(claim: Claim, longest: float = RECORDING) -> str:
    """Why a sound is refused, as a clause without a subject ("claims …"); empty if it is accepted.

    Args:
        claim: What the sound's header says.
        longest: Longest duration that is accepted, in seconds.
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
    """The claim of a sound file, in any format that libsndfile (package soundfile) reads.

    Raises:
        OSError: If the file cannot be opened.
        RuntimeError: If the file cannot be read as sound.
    """
    import soundfile

    info = soundfile.info(str(path))
    return Claim(info.samplerate, info.channels, info.frames)


def open_wav(file: BinaryIO) -> wave.Wave_read:
    """Opens a WAV file, if its sound comes after few chunks.

    Python's `wave` goes through millions of empty ones, seconds long, and holds up all threads.

    Raises:
        wave.Error: If the file is no WAV file, or has more than `MOST_CHUNKS` before its sound.
        EOFError: If the file ends too early.
    """
    file.seek(12)
    for _ in range(MOST_CHUNKS):
        head = file.read(8)
        if len(head) < 8 or head[:4] == b"data":
            file.seek(0)
            return wave.open(file, "rb")
        size = int.from_bytes(head[4:], "little")
        file.seek(size + size % 2, io.SEEK_CUR)
    raise wave.Error(f"more than {MOST_CHUNKS} chunks before its sound")


def open_claim(sound: wave.Wave_read, size: int) -> Claim:
    """The claim of an opened WAV file, its length limited by the size of the file.

    The header of a WAV file that was streamed while being recorded claims more than the file holds.

    Args:
        sound: The opened file.
        size: Size of the file in bytes.
    """
    width, channels = sound.getsampwidth(), sound.getnchannels()
    frames = min(sound.getnframes(), size // (width * channels))
    return Claim(sound.getframerate(), channels, frames, width)


def wav_claim(head: bytes) -> Claim | None:
    """The claim of a plain WAV header of 44 bytes, without the length; None for other bytes."""
    if len(head) < _WAV.size:
        return None
    riff, wave, form, _, channels, rate, bits = _WAV.unpack_from(head)
    if (riff, wave, form) != (b"RIFF", b"WAVE", b"fmt "):
        return None
    return Claim(rate, channels, width=bits // 8)


def wav_bytes(samples: NDArray[np.floating[Any]], rate: int) -> bytes:
    """A WAV file, mono with 16 bits, of samples (S,) in [-1, 1]; what is beyond is cut off."""
    data = io.BytesIO()
    with wave.open(data, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes((np.clip(samples, -1, 1) * 32767).astype("<i2").tobytes())
    return data.getvalue()
