"""Runs pocketsphinx, a speech recogniser, in a process of its own.

pocketsphinx holds Python's interpreter lock while it decodes. In a thread of the server, decoding
the first 0.7 s of a sentence would block everything else for about 0.2 s.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# (pocketsphinx is untyped)

import asyncio
import os
import signal
import struct
import sys
from typing import BinaryIO

_LENGTH = struct.Struct("<i")
_FINISH = -1  # in the place of a length
_RATE = 16_000  # Hz
YIELDING = 10  # niceness: many who speak at once keep nobody's answer from a core


class DecoderLostError(Exception):
    """The decoder's process has ended; the next call starts a new one."""


class SphinxProcess:
    """A decoder in its own process, which takes about 120 MB and 0.5 s to start."""

    def __init__(self):
        """Starts no process yet; the first call does."""
        self._process: asyncio.subprocess.Process | None = None
        self._starting = asyncio.Lock()

    async def start(self) -> None:
        """Starts the process unless it is running."""
        async with self._starting:
            if self._process is None:
                self._process = await asyncio.create_subprocess_exec(
                    # -P: nothing is imported from the folder in which somebody starts the server
                    *(sys.executable, "-P", "-m", __name__),
                    stdin=asyncio.subprocess.PIPE,
                    stdout=asyncio.subprocess.PIPE,
                )

    async def decode(self, pcm: bytes) -> str:
        """Decodes more sound; returns the words recognised so far.

        Args:
            pcm: PCM, 16 bits, mono, 16 kHz.

        Raises:
            DecoderLostError: If the process has ended.
        """
        return await self._ask(len(pcm), pcm)

    async def finish(self) -> str:
        """Ends the utterance; returns the words of all sound since the last call of `finish`.

        Raises:
            DecoderLostError: If the process has ended.
        """
        return await self._ask(_FINISH, b"")

    async def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None
        process.stdin.close()  # it ends with its input, in the midst of nothing
        try:
            await asyncio.wait_for(process.wait(), 1.0)
        except TimeoutError:
            process.kill()
            await process.wait()

    async def _ask(self, number: int, sound: bytes) -> str:
        await self.start()
        assert self._process is not None
        to, back = self._process.stdin, self._process.stdout
        assert to is not None and back is not None
        try:
            to.write(_LENGTH.pack(number) + sound)
            await to.drain()
            (length,) = _LENGTH.unpack(await back.readexactly(_LENGTH.size))
            return (await back.readexactly(length)).decode()
        except (ConnectionError, asyncio.IncompleteReadError):
            await self.close()
            raise DecoderLostError("the decoder's process has ended") from None


def serve(asked: BinaryIO, told: BinaryIO) -> None:
    """Main loop of the decoder's process: reads sound from `asked`, writes words to `told`."""
    from pocketsphinx import Decoder

    # without the flat second pass the last words come 5 times sooner and no worse
    decoder = Decoder(samprate=_RATE, loglevel="FATAL", fwdflat=False)
    speaking = False
    while header := asked.read(_LENGTH.size):
        (number,) = _LENGTH.unpack(header)
        known = speaking or number != _FINISH  # else there is nothing to finish
        if number == _FINISH and speaking:
            decoder.end_utt()
        elif number != _FINISH:
            if not speaking:
                decoder.start_utt()
            decoder.process_raw(asked.read(number), False, False)
        speaking = number != _FINISH
        hypothesis = decoder.hyp() if known else None
        words = (hypothesis.hypstr if hypothesis else "").encode()
        told.write(_LENGTH.pack(len(words)) + words)
        told.flush()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    if hasattr(os, "nice"):  # not on Windows
        os.nice(YIELDING)
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except BrokenPipeError:
        os._exit(0)  # whoever asked is gone, and Python would say so
