"""Voices that speak in threads: as many at a time as there are cores, and nobody who has gone."""

import asyncio
import os
import threading

import numpy as np

from ico3d.chat.services.voice.base import PieceVoice, Spoken


async def said(voice, text):
    return [frame async for frame in voice.run_tts(text, "1")]


async def test_who_is_interrupted_leaves_the_line_and_takes_no_thread():
    """Portions that nobody waited for held the threads of all sessions, for seconds."""
    begun, may_end = [], threading.Event()

    def speak(text):
        begun.append(text)
        may_end.wait(10)
        return Spoken(np.zeros(2400, np.int16))

    cores = os.cpu_count() or 1
    voices = [PieceVoice("any", speak) for _ in range(cores + 5)]
    talks = [asyncio.create_task(said(v, str(n))) for n, v in enumerate(voices)]
    while len(begun) < cores:
        await asyncio.sleep(0)  # time does not go on while threads work
    for task in talks[cores:-1]:
        task.cancel()
    await asyncio.sleep(0)
    assert len(begun) == cores
    may_end.set()
    assert len(await talks[-1]) == 1  # who still waits is served
    await asyncio.gather(*talks[:cores])
    assert sorted(begun, key=int) == [*map(str, range(cores)), str(len(voices) - 1)]
