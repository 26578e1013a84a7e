"""What is left to chance is another thing for each visitor, and for the session's own time."""

import asyncio

import numpy as np

from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire.protocol import Text
from ico3d.measure.talking.scripted import Script
from support.chat.guests import Guest, open_sessions
from support.chat.virtual_time import run


def test_two_visitors_see_the_same_lips_and_other_brows(bundle):
    async def talk():
        async with open_sessions(bundle, Script(0, 0, 0).services(), ChatSettings()) as sessions:
            guests = [await Guest.enter(sessions) for _ in range(2)]
            await asyncio.sleep(3)  # the greeting
            for guest in guests:
                await guest.session.conversation.handle(Text("and now?"))
            await asyncio.sleep(5)
            faces = [np.concatenate([s.expressions for s in guest.speech()]) for guest in guests]
            for guest in guests:
                await guest.leave()
            return faces

    one, other = run(talk())
    eyes = bundle.manifest.head.eye_offset
    assert len(one) > 50
    np.testing.assert_array_equal(one[:, :eyes], other[:, :eyes])
    assert np.abs(one[:, eyes : eyes + 5] - other[:, eyes : eyes + 5]).max() > 0.005
