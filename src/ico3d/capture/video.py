"""Reads video files: pictures by time, and sound from the time of the first picture."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.capture import decoding
from ico3d.capture.capture import Sound
from ico3d.capture.decoding import check_size
from ico3d.capture.sound import check_claim, joined
from ico3d.capture.vetting.held import check_held, set_threads
from ico3d.capture.vetting.promises import MOST_TRACKS, check_promises
from ico3d.capture.vetting.rehearsal import rehearse
from ico3d.common.sound import RECORDING, Claim
from ico3d.errors import CaptureError

SOUND_RATE = 16_000
BOXES = "mov,mp4"
"""FFmpeg's names for MP4 and QuickTime, which are opened only where `check_promises` knew them."""
FORMATS = (
    "matroska,webm,avi,mpegts,mpeg,mpegvideo,m4v,h264,hevc,ivf,flv,asf,ogg,mxf,nut,gif,dv,rm,y4m,"
    "yuv4mpegpipe"
)
"""Other kinds of files that are opened, by FFmpeg's names: none that leads to other files."""
LARGEST_PACKET, LONGEST_PIECE = 1 << 15, 1 << 14
"""Bytes of compressed sound that are decoded at once, and samples of one piece of it.

A packet may have hundreds of pieces, of 42 bytes each where they are silent.
"""


@dataclass
class Video:
    """Facts about a video file; counts are updated while the file is read.

    Attributes:
        path: The file.
        width: Width in pixels of the pictures that `frames` yields, display rotation applied.
        height: Height in pixels of the pictures that `frames` yields, display rotation applied.
        scale: Size of yielded pictures as a factor of that in the file.
        announced: Number of pictures that the file claims; 0 if it does not say.
        rate: Mean pictures per second that the file claims; 0 if it does not say.
        damaged: Number of packets that could not be decoded.
        decoded: Number of pictures that were decoded.
        times: Seconds of each decoded picture after the first one.
    """

    path: Path
    width: int
    height: int
    scale: float
    announced: int
    rate: float
    damaged: int = field(default=0)
    decoded: int = field(default=0)
    times: list[float] = field(default_factory=list)

    def frames(self, fps: float) -> Iterator[np.ndarray]:
        """Yields pictures resampled by time: number k is the one nearest to k / fps seconds.

        Args:
            fps: Pictures per second to yield.

        Yields:
            uint8 RGB (height, width, 3), contiguous.

        Raises:
            CaptureError: If not a single picture can be decoded, or the video is longer than
                `RECORDING`: two pictures far apart would be repeated for ever in between.
        """
        for picture, _ in self.sampled(fps):
            yield picture

    def sampled(self, fps: float) -> Iterator[tuple[np.ndarray, bool]]:
        """The pictures of `frames`, and whether each was taken at its moment.

        It was where its own time is no farther than 0.5 / fps seconds away; in slower videos and in
        gaps, pictures stand in for moments that have none.

        Args:
            fps: Pictures per second to yield.

        Yields:
            uint8 RGB (height, width, 3), contiguous, and True or False.

        Raises:
            CaptureError: As `frames`.
        """
        count, before = 0, None
        for now in self._timed():
            while before is not None and count / fps < (before[0] + now[0]) / 2:
                yield before[1], _is_near(count / fps, before[0], fps)
                count += 1
            before = now
        if before is None:
            raise CaptureError.of("no-picture", f"{self.path}: ")
        if count / fps <= before[0] + 0.5 / fps:
            yield before[1], _is_near(count / fps, before[0], fps)

    def _timed(self) -> Iterator[tuple[float, np.ndarray]]:
        """Every picture of the file with its seconds after the first one."""
        with opened(self.path) as container:
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            first = None
            for frame in decoded_frames(container, stream):
                if frame is None:
                    self.damaged += 1
                    continue
                self.decoded += 1
                seconds = frame.time if frame.time is not None else (first or 0.0) + self.decoded
                first = seconds if first is None else first
                if seconds - first > RECORDING:
                    raise CaptureError.of("long", f"{self.path}: ", values={"n": round(RECORDING)})
                self.times.append(seconds - first)
                yield self.times[-1], self._picture(frame)

    def _picture(self, frame) -> np.ndarray:
        """One decoded frame, scaled and turned as it is to be displayed."""
        turns = frame.rotation // 90 % 4
        size = (self.width, self.height) if turns % 2 == 0 else (self.height, self.width)
        scaled = frame.reformat(*size, format="rgb24", interpolation="AREA")
        # Rows are padded in the decoder's buffer; MediaPipe needs them without gaps.
        return np.ascontiguousarray(np.rot90(scaled.to_ndarray(), turns))


def _is_near(wanted: float, taken: float, fps: float) -> bool:
    """Whether a time is within half a step of another, in seconds; times in files are rounded."""
    return abs(wanted - taken) <= 0.501 / fps


def opened(path: Path) -> Any:
    """A PyAV container of a file, which cannot make FFmpeg open another file or an address.

    Its decoders refuse larger pictures than the file states, which would fill the memory. Every
    video is opened here: what its tables promise is looked at first.

    Raises:
        CaptureError: If the file states larger pictures than are taken (`decoding.check_size`), or
            promises more than it can hold (`check_promises`), or costs too much (`rehearse`,
            `check_held`).
        FFmpegError: If it is no video, or is a play list.
        OSError: If it cannot be read.
    """
    import av

    formats = BOXES if check_promises(path) else FORMATS
    bounds = {"format_whitelist": formats, "protocol_whitelist": "file"}
    bounds["max_streams"] = str(MOST_TRACKS)  # FFmpeg begins to decode each
    # pictures are decoded while a file is opened, of every stream
    pixels = {"max_pixels": str(decoding.MOST_PIXELS)}
    how = {"metadata_errors": "replace", "container_options": bounds, "options": pixels}
    rehearse(path, how)
    container = av.open(str(path), **how)
    try:
        for stream in container.streams.video:
            if stream.codec_context is not None:
                check_size(str(path), stream.codec_context.width, stream.codec_context.height)
                stream.codec_context.options = pixels
                set_threads(stream.codec_context)
                check_held(str(path), stream.codec_context)
        for stream in container.streams.audio:
            if stream.codec_context is not None and _is_compressed(stream):
                stream.codec_context.options = {"max_samples": str(LONGEST_PIECE)}
    except CaptureError:
        container.close()
        raise
    return container


def open_video(path: Path, size: int) -> Video:
    """Opens a video file and reads its facts.

    Args:
        path: The file.
        size: Upper limit of the pictures' short side in pixels; larger videos are scaled down.

    Raises:
        CaptureError: If the file is missing, is no video, cannot be opened, or has larger pictures
            than are taken.
    """
    from av.error import FFmpegError

    if not os.path.isfile(path):
        raise CaptureError.of("gone", f"{path}: ")
    try:
        with opened(path) as container:
            if not container.streams.video:
                raise CaptureError.of("streamless", f"{path}: ")
            stream = container.streams.video[0]
            if stream.codec_context is None:
                raise CaptureError.of("kind", f"{path}: ")
            width, height = stream.codec_context.width, stream.codec_context.height
            frame = next(container.decode(stream), None)
            turned = frame is not None and frame.rotation // 90 % 2 == 1
            announced, rate = stream.frames, float(stream.average_rate or 0)
    except (FFmpegError, OSError) as error:
        raise CaptureError.of("decoding", f"{path}: ", f" ({error}).") from error
    if frame is None or width * height == 0:
        raise CaptureError.of("no-picture", f"{path}: ")
    scale = min(1.0, size / min(width, height))
    width, height = round(width * scale), round(height * scale)
    return Video(path, *((height, width) if turned else (width, height)), scale, announced, rate)


def read_sound(path: Path, rate: int = SOUND_RATE) -> Sound | None:
    """The sound of a video file, mono; sample 0 belongs to the first picture.

    Args:
        path: The file.
        rate: Samples per second of what is returned.

    Returns:
        The sound, or None if the file has none.

    Raises:
        CaptureError: If the sound claims more than is accepted (`common.sound.fault`).
    """
    import av

    with opened(path) as container:
        if not container.streams.audio or container.streams.audio[0].codec_context is None:
            return None
        stream, offset = container.streams.audio[0], _sound_offset(container)
        check_claim(path, Claim(stream.rate, frames=int(abs(offset) * stream.rate)))
        mono = av.AudioResampler("flt", "mono", stream.rate)
        pieces = (
            out.to_ndarray()[0]
            for frame in _sound_frames(path, container, stream, max(offset, 0.0))
            for out in mono.resample(frame)
        )
        later = round(offset * rate)
        silence = max(later, 0)
        samples = joined(pieces, stream.rate, rate, silence)
    return Sound(samples[max(-later, 0) :], rate) if len(samples) > silence else None


def _sound_frames(path: Path, container, stream, behind: float) -> Iterator:
    """The decoded pieces of a sound, for as long as it keeps to what is taken.

    It starts `behind` seconds behind the pictures, which count.
    """
    samples = int(behind * stream.rate)
    for frame in decoded_frames(container, stream):
        if frame is None:
            continue
        samples += frame.samples
        check_claim(path, Claim(frame.sample_rate, frame.layout.nb_channels, samples))
        yield frame


def _sound_offset(container) -> float:
    """Seconds by which the sound starts after the first picture; 0 where there are no pictures."""
    if not container.streams.video:
        return 0.0
    starts = [
        float((stream.start_time or 0) * stream.time_base)
        for stream in (container.streams.audio[0], container.streams.video[0])
    ]
    return starts[0] - starts[1]


def decoded_frames(container: Any, stream: Any) -> Iterator[Any]:
    """Decodes packet by packet, so that a damaged packet does not affect others.

    Args:
        container: An open PyAV container, from its current position on.
        stream: The stream of pictures or sound.

    Yields:
        Frames of PyAV; None for a packet that is damaged, or may hold too much sound.

    Raises:
        CaptureError: If the pictures become such that the decoder takes too much memory.
    """
    from av.error import FFmpegError

    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets, None)
            if packet is None:
                return
            frames = [None] if _is_large(stream, packet) else packet.decode()
        except (FFmpegError, EOFError, OSError):
            frames = [None]
        if stream.type == "video":
            check_held(container.name, stream.codec_context)
        yield from frames


def _is_large(stream: Any, packet: Any) -> bool:
    """Whether a packet may hold many pieces of compressed sound, which are decoded at once."""
    return _is_compressed(stream) and packet.size > LARGEST_PACKET


def _is_compressed(stream: Any) -> bool:
    """Whether a stream of PyAV is of sound that takes more memory than in its file."""
    return stream.type == "audio" and not stream.codec_context.name.startswith("pcm_")
