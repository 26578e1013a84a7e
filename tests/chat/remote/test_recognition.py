"""Sound that another machine sends is judged by what it claims before it is made larger."""

import asyncio
import io
import struct
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pipecat.frames.frames import InputAudioRawFrame
from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.remote.headless import MOST_AHEAD, run
from ico3d.chat.remote.limits import Limits
from ico3d.chat.remote.recognition import heard, read_wav
from ico3d.chat.wire.protocol import MICROPHONE_CHUNK
from ico3d.errors import ProtocolError
from support.chat.remote import service_app, serving
from support.chat.serving import visiting

RATE = 16_000
LONGEST = 600  # s
MB = 1 << 20


def wav(rate, channels, bits, claimed, payload):
    """A WAV file whose header says what it likes."""
    size = bits // 8 * channels
    form = struct.pack("<HHIIHH", 1, channels, rate, rate * size & 0xFFFFFFFF, size & 0xFFFF, bits)
    chunks = b"fmt " + struct.pack("<I", 16) + form + b"data" + struct.pack("<I", claimed) + payload
    return b"RIFF" + struct.pack("<I", 0xFFFFFFFF) + b"WAVE" + chunks


class Deaf(FrameProcessor):
    """A recogniser that understands nothing."""

    async def process_frame(self, frame, direction):
        await super().process_frame(frame, direction)
        await self.push_frame(frame, direction)


async def posted(data, limits=None):
    """The answer to a file, and the most memory that it took."""
    app = service_app("recognition", Deaf, limits or Limits(seconds=3))
    async with serving(app) as url, visiting(url) as client:
        path = "v1/audio/transcriptions"
        await client.post(path, files={"file": wav(RATE, 1, 16, 3200, bytes(3200))})
        tracemalloc.start()
        answer = await client.post(path, files={"file": data})
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return answer, peak


@pytest.mark.parametrize(
    ("rate", "channels", "claims"),
    [(1, 1, "1 samples"), (0, 1, "0 samples"), (RATE, 500, "500 ch")],
)
async def test_two_kilobytes_stay_small(rate, channels, claims):
    answer, peak = await posted(wav(rate, channels, 16, 2000, bytes(2000)))
    assert peak < 30 * MB
    assert answer.status_code == 400
    assert claims in answer.json()["error"]["message"]


async def test_more_than_ten_minutes_are_refused_before_they_are_decoded():
    data = wav(4000, 1, 8, 4000 * (LONGEST + 1), bytes(4000 * (LONGEST + 1)))
    answer, peak = await posted(data)
    assert peak < 4 * len(data) + 30 * MB
    assert answer.status_code == 400 and "longer than 600 s" in answer.json()["error"]["message"]


async def test_an_upload_that_tells_no_length_is_not_kept():
    async def endless():
        yield b'--x\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'
        for _ in range(200):
            yield bytes(MB // 4)

    app = service_app("recognition", Deaf, Limits(megabytes=1))
    async with serving(app) as url, visiting(url) as client:
        tracemalloc.start()
        kind = {"Content-Type": "multipart/form-data; boundary=x"}
        path = "v1/audio/transcriptions"
        answer = await client.post(path, content=endless(), headers=kind)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 10 * MB
    assert answer.status_code == 413 and "larger than 1 MB" in answer.json()["error"]["message"]


@settings(max_examples=150)
@given(
    rate=st.one_of(st.integers(0, 2**32 - 1), st.integers(4000, 48_000)),
    channels=st.one_of(st.integers(0, 65_535), st.integers(1, 4)),
    bits=st.sampled_from([0, 8, 16, 24, 32, 64]),
    claimed=st.one_of(st.integers(0, 2**32 - 1), st.integers(0, 4000)),
    payload=st.binary(max_size=4000),
)
def test_no_header_makes_sound_large(rate, channels, bits, claimed, payload):
    data = wav(rate, channels, bits, claimed, payload)
    tracemalloc.start()
    try:
        pcm = read_wav(io.BytesIO(data))
    except ProtocolError:
        pcm = None
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MB
    if pcm is not None:
        frames = min(claimed, len(payload)) // (bits // 8 * channels)
        assert abs(len(pcm) - frames * RATE / rate) <= 2


def test_a_part_that_claims_more_than_the_file_is_refused():
    data = bytearray(wav(RATE, 1, 16, 3200, bytes(3200)))
    data[4:8], data[16:20] = (500).to_bytes(4, "little"), (0x1020).to_bytes(4, "little")
    with pytest.raises(ProtocolError, match="no WAV file"):
        read_wav(io.BytesIO(bytes(data)))


@pytest.mark.parametrize(
    "chunk", [b"abcd\0\0\0\0", b"abcd\1\0\0\0xx", b"fmt \x10\0\0\0" + bytes(16)]
)
def test_a_file_of_many_chunks_is_refused_before_they_are_gone_through(chunk):
    data = wav(RATE, 1, 16, 3200, bytes(3200))
    many = data[:12] + chunk * 65 + data[12:]
    with pytest.raises(ProtocolError, match="more than 64 chunks before its sound"):
        read_wav(io.BytesIO(many))
    few = data[:12] + b"abcd\1\0\0\0xx" * 60 + data[12:]
    assert len(read_wav(io.BytesIO(few))) == 1600


def test_a_file_that_claims_more_than_it_holds_is_read():
    pcm = read_wav(io.BytesIO(wav(RATE, 1, 16, 0xFFFFFFFE, bytes(3200))))
    assert len(pcm) == 1600


@pytest.mark.parametrize("charset", ["punycode", "utf-16", "no-such", "idna", '"utf-7"'])
async def test_a_form_in_an_odd_coding_is_not_decoded(charset):
    body = form(bytes(wav(RATE, 1, 16, 3200, bytes(3200))))
    app, statuses = service_app("recognition", Deaf, Limits(seconds=3)), []
    async with serving(app) as url, visiting(url) as client:
        for given in (f"; charset={charset}", "", "; charset=UTF-8", '; charset="utf8"'):
            headers = {"Content-Type": "Multipart/Form-Data; boundary=xx" + given}
            answer = await client.post("v1/audio/transcriptions", content=body, headers=headers)
            statuses.append(answer.status_code)
    assert statuses == [400, 200, 200, 200]


def form(data):
    """A form with a file, which a field precedes that some codings take long to decode."""
    field = b'Content-Disposition: form-data; name="x"\r\n\r\n' + 10_000 * b"a"
    file = b'Content-Disposition: form-data; name="file"; filename="a.wav"\r\n\r\n' + data
    return b"--xx\r\n" + field + b"\r\n--xx\r\n" + file + b"\r\n--xx--\r\n"


async def test_ten_minutes_keep_nobody_waiting():
    """Others get their turns all along; handed over at once, it would be a third of the time."""
    gaps: list[float] = []
    now = time.process_time  # others use the machine, too

    async def wait_for_turns():
        while True:
            before = now()
            await asyncio.sleep(0)
            gaps.append(now() - before)

    waiting = asyncio.create_task(wait_for_turns())
    begun = now()
    found = [frame async for frame in run(Deaf(), heard(np.zeros(RATE * LONGEST, np.int16)), 300)]
    waiting.cancel()
    assert len(found) > RATE * LONGEST / MICROPHONE_CHUNK
    assert max(gaps) < 0.15 * (now() - begun)


class Slow(Deaf):
    """A recogniser that takes sound at once and works on it later."""

    waiting, most = 0.0, 0.0

    async def process_frame(self, frame, direction):
        await super().process_frame(frame, direction)
        if isinstance(frame, InputAudioRawFrame):
            self.waiting += frame.num_frames / frame.sample_rate
            self.most = max(self.most, self.waiting)
            asyncio.get_running_loop().call_later(0.2, self.work, frame)

    def work(self, frame):
        self.waiting -= frame.num_frames / frame.sample_rate


async def test_no_more_sound_waits_than_a_recogniser_would_take():
    slow = Slow()
    assert [frame async for frame in run(slow, heard(np.zeros(RATE * 90, np.int16)), 60)]
    assert 5 < slow.most < MOST_AHEAD + 2
