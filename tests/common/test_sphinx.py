"""The decoder in a process of its own: the words of a decoder in this one, and a fresh start."""

import asyncio
import os

import numpy as np
import pytest
import soxr

from ico3d.common.espeak.speech import synthesize
from ico3d.common.sphinx import YIELDING, DecoderLostError, SphinxProcess

pytestmark = pytest.mark.slow

pocketsphinx = pytest.importorskip("pocketsphinx")


def question():
    """PCM16 mono 16 kHz."""
    speech = synthesize("What is your name?", "en-us", 150)
    samples = soxr.resample(speech.samples, speech.rate, 16_000) * 0.3
    noise = np.random.default_rng(0).normal(0, 1e-3, len(samples))
    return (np.clip(samples + noise, -1, 1) * 32767).astype(np.int16).tobytes()


async def hear(decoder, sound, step=3200):
    for at in range(0, len(sound), step):
        await decoder.decode(sound[at : at + step])
    return await decoder.finish()


async def test_it_hears_what_a_decoder_hears():
    own = pocketsphinx.Decoder(samprate=16_000, loglevel="FATAL", fwdflat=False)
    decoder, sound = SphinxProcess(), question()
    assert await decoder.finish() == ""  # of nothing
    for _ in range(2):  # what it adapts to goes over to the next utterance
        own.start_utt()
        for at in range(0, len(sound), 3200):
            own.process_raw(sound[at : at + 3200], False, False)
        own.end_utt()
        assert await hear(decoder, sound) == own.hyp().hypstr
    assert await decoder.finish() == ""
    await decoder.close()


async def test_the_loop_goes_on_while_it_decodes():
    decoder, sound = SphinxProcess(), question()
    await decoder.finish()  # the model is loaded
    task = asyncio.create_task(decoder.decode(3 * sound))
    ticks = 0
    while not task.done():
        await asyncio.sleep(0.001)
        ticks += 1
    assert ticks > 5
    await decoder.close()


@pytest.mark.skipif(not hasattr(os, "nice"), reason="this system knows no niceness")
async def test_it_leaves_the_cores_to_whoever_asks():
    """Eight who spoke at once kept the server itself waiting for a core for seconds."""
    decoder = SphinxProcess()
    await decoder.finish()
    own, its = (os.getpriority(os.PRIO_PROCESS, of) for of in (0, decoder._process.pid))
    assert its == min(19, own + YIELDING)
    await decoder.close()


async def test_one_that_died_is_followed_by_another():
    decoder, sound = SphinxProcess(), question()
    words = await hear(decoder, sound)
    decoder._process.kill()
    with pytest.raises(DecoderLostError):
        await hear(decoder, sound)
    assert await hear(decoder, sound) == words
    process = decoder._process
    await decoder.close()
    assert process.returncode == 0


async def test_it_imports_nothing_from_the_folder_of_its_start(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pocketsphinx.py").write_text("raise SystemExit('taken over')")
    decoder = SphinxProcess()
    assert await decoder.finish() == ""
    await decoder.close()
