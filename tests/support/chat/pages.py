"""Pages that do one thing more, or one thing only."""

import asyncio
import os

import numpy as np
from websockets.asyncio.client import connect

from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import VERSION, Clock, Hello, Stop, Timeline
from ico3d.measure.talking.page import Player


def slowness():
    """How much longer things take by the real clock on a machine that does other things besides."""
    return max(1.0, 2 * os.getloadavg()[0] / (os.cpu_count() or 1))


async def first_message(url):
    """What a new page is told first."""
    async with connect(url.replace("http", "ws") + "ws") as wire:
        await wire.send(encode(Hello(VERSION, None, -1)))
        return decode_server(await asyncio.wait_for(wire.recv(), 30))


class FollowingPlayer(Player):
    """Its body stands at the rest's begin until it is told where to go."""

    def __init__(self):
        super().__init__()
        self.points = []

    def take(self, message, now):
        super().take(message, now)
        if isinstance(message, Timeline) and message.utterance == self.utterance:
            self.points += message.points
        elif isinstance(message, Stop):
            self.points = []

    def clock(self, now):
        clock = super().clock(now)
        if clock is None or not self.points:
            return clock
        place = float(np.interp(clock.position, *np.array(self.points).T))
        return Clock(clock.utterance, clock.position, place)
