"""Random access to the pictures of a video."""

import os
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ico3d.capture.vetting import held
from ico3d.capture.video import decoded_frames, opened
from ico3d.errors import CaptureError, MissingExtraError

MOST_OPEN = 4
"""Number of decoders that are kept, where they may take as much memory as one may."""


class Clip:
    """A video whose picture k, in the order of display, is frame k.

    Consecutive pictures are decoded once; for others decoding starts at the preceding key picture.
    Decoding uses one thread and belongs to one process: a copy that was pickled, or inherited by a
    forked process, opens the file again.
    """

    def __init__(self, path: Path):
        """Takes the path; the file is opened when a picture is needed.

        Args:
            path: Path of the video.
        """
        self.path = path
        self._index: _Index | None = None
        self._decoder: _Decoder | None = None

    def __getstate__(self) -> dict:
        return {"path": self.path, "_index": self._index, "_decoder": None}

    def apart(self) -> "Clip":
        """The same video, to be opened once more."""
        other = Clip(self.path)
        other._index = self._index
        return other

    @property
    def count(self) -> int:
        """Number of pictures in the file.

        Raises:
            CaptureError: If the file cannot be read.
        """
        return len(self._known().times)

    def picture(self, number: int) -> np.ndarray | None:
        """A picture, uint8 RGB (H, W, 3), or None if the video has fewer pictures.

        Raises:
            CaptureError: If the picture cannot be decoded.
        """
        index = self._known()
        if number >= len(index.times):
            return None
        if self._decoder is None or self._decoder.process != os.getpid():
            self.close()
            self._decoder = _Decoder(self.path)
        frame = self._decoder.frame(index, number)
        if frame is None:
            raise CaptureError(f"{self.path}: frame {number} is damaged and cannot be decoded.")
        turns = frame.rotation // 90 % 4
        return np.ascontiguousarray(np.rot90(frame.to_ndarray(format="rgb24", threads=1), turns))

    @property
    def held_bytes(self) -> int:
        """Bytes that its decoder can take: the open one, or one that is opened.

        Raises:
            CaptureError: If the file cannot be read.
        """
        return self._known().held_bytes if self._decoder is None else self._decoder.held_bytes

    def close(self) -> None:
        """Closes the file; the next call of `picture` opens it again."""
        if self._decoder is not None:
            self._decoder.close()
        self._decoder = None

    def _known(self) -> "_Index":
        """Where the pictures are, looked up once."""
        self._index = self._index or _Index(self.path)
        return self._index


class OpenClips:
    """A cache of open clips, from which the least recently used ones are closed.

    Threads take turns: a decoder goes on from the picture that it decoded last.
    """

    def __init__(self):
        """Starts with an empty cache."""
        self._used: OrderedDict[Path, Clip] = OrderedDict()
        self._turn = Lock()

    def __getstate__(self) -> dict:
        return {"_used": self._used}

    def __setstate__(self, state: dict) -> None:
        self.__dict__ |= state | {"_turn": Lock()}

    def picture(self, clip: Clip, number: int) -> np.ndarray | None:
        """A picture of a clip, as `Clip.picture` returns it."""
        with self._turn:
            self._used[clip.path] = clip
            self._used.move_to_end(clip.path)
            while len(self._used) > 1 and self._are_many():
                self._used.popitem(last=False)[1].close()
            return clip.picture(number)

    def _are_many(self) -> bool:
        """Whether the clips are more than may be open, in number or in memory."""
        taken = sum(clip.held_bytes for clip in self._used.values())
        return len(self._used) > MOST_OPEN or taken > held.MOST_BYTES


class _Index:
    """When each picture is shown, and from where it can be decoded."""

    def __init__(self, path: Path):
        """Goes through the packets of a file without decoding them."""
        found, self.held_bytes = _packets(path)
        packets = [p for p in found if not p.is_discard]
        if not packets or any(p.pts is None for p in packets):
            raise CaptureError(
                f"{path} does not say when its pictures are shown: convert it to MP4 with H.264."
            )
        self.times: list[int] = sorted(int(p.pts) for p in packets)
        keys = sorted((int(p.pts), int(p.dts)) for p in packets if p.is_keyframe)
        self._key_times = [shown for shown, _ in keys]
        self._key_places = [place for _, place in keys]

    def key(self, time: int) -> int:
        """The number of the key picture shown at or before a time; -1 where there is none."""
        return bisect_right(self._key_times, time) - 1

    def starts(self, time: int) -> list[int]:
        """Where decoding may start for a picture, best first; the earlier ones are surer."""
        key = self.key(time)
        before = self._key_places[max(key - 1, 0) : key + 1]
        return [*reversed(before), min(self._key_places, default=0)]


class _Decoder:
    """An open file, and the picture that was decoded last."""

    def __init__(self, path: Path):
        """Opens the file."""
        self.process = os.getpid()
        self._container = _opened(path)
        self._stream = self._container.streams.video[0]
        # Threads would not survive a fork, and training reads in several processes.
        self._stream.codec_context.thread_count = 1
        self._frames: Iterator[Any] = iter(())
        self._last: Any = None
        self._broken = False

    @property
    def held_bytes(self) -> int:
        """Bytes that its pictures can take."""
        return held.held_bytes(self._stream.codec_context)

    def close(self) -> None:
        """Closes the file: a container and its streams hold one another."""
        self._last = None
        self._container.close()

    def frame(self, index: _Index, number: int) -> Any:
        """The decoded frame, or None where it cannot be had."""
        time = index.times[number]
        if self._last is not None:
            last = self._last.pts
            if last == time:
                return self._last
            if last < time and index.key(last) == index.key(time) and self._advance(time):
                return self._last
        for start in index.starts(time):
            self._container.seek(start, stream=self._stream, backward=True)
            self._frames, self._broken = decoded_frames(self._container, self._stream), False
            if self._advance(time):
                return self._last
        return None

    def _advance(self, time: int) -> bool:
        """Decodes up to the picture of a time."""
        for frame in self._frames:
            if frame is None:
                self._broken = True
                continue
            # What follows a lost picture is made of it, up to the next key picture.
            self._broken = (self._broken and not frame.key_frame) or frame.is_corrupt
            if frame.pts is not None and frame.pts >= time:
                self._last = None if self._broken else frame
                return frame.pts == time and not self._broken
        self._last = None
        return False


def _opened(path: Path) -> Any:
    """A container with a video stream."""
    try:
        from av.error import FFmpegError
    except ImportError:
        raise MissingExtraError("av", "train", "reading videos") from None
    try:
        container = opened(path)
    except FileNotFoundError as error:
        raise CaptureError(f"{path} is missing.") from error
    except (FFmpegError, OSError, ValueError) as error:
        raise CaptureError(f"{path} cannot be read as a video; is it damaged?") from error
    if not any(stream.codec_context for stream in container.streams.video[:1]):
        container.close()
        raise CaptureError(f"{path} holds no video stream that can be decoded here.")
    return container


def _packets(path: Path) -> tuple[list[Any], int]:
    """The packets of a file's first video stream, up to where it is damaged.

    Besides, the bytes that its decoder can take.
    """
    from av.error import FFmpegError

    found = []
    with _opened(path) as container:
        stream = container.streams.video[0]
        taken = held.held_bytes(stream.codec_context)
        try:
            for packet in container.demux(stream):
                if packet.size:
                    found.append(_Packet(packet))
        except (FFmpegError, OSError):
            pass  # what comes after the damage is missing
    return found, taken


class _Packet:
    """What the index needs of a packet; packets themselves would hold the whole file."""

    __slots__ = ("dts", "is_discard", "is_keyframe", "pts")

    def __init__(self, packet: Any):
        self.pts = packet.pts
        self.dts = packet.pts if packet.dts is None else packet.dts  # Matroska has none
        self.is_keyframe, self.is_discard = packet.is_keyframe, packet.is_discard
