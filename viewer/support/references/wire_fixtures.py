"""Messages as the server frames them, and what a page's frames mean to it.

Run: python wire_fixtures.py encode OUT      writes one file per server message
     python wire_fixtures.py decode FILES…   prints the client messages as JSON
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ico3d.chat.wire.codec import decode_client, encode
from ico3d.chat.wire.protocol import (
    Dictation,
    End,
    Notice,
    Offer,
    Service,
    Services,
    Speech,
    State,
    Welcome,
)

NOTICE = "No speech in this avatar, sagt sie – schade."


def server_messages() -> list:
    """One of each kind that matters, with text beyond ASCII."""
    service = Service("offline", True)
    services = Services(service, service, Service("cloud", False))
    pcm = np.arange(-1200, 1200, dtype=np.int16)  # 100 ms
    expressions = (np.arange(3 * 39).reshape(3, 39) / 64 - 1).astype(np.float16)
    return [
        Welcome(
            1,
            "session",
            False,
            services,
            [Notice("still-lips", NOTICE)],
            Dictation("de-DE", None),
            [Offer("voice", "a", "A", "install it.")],
            True,
        ),
        State("thinking"),
        Speech(3, 7, 4800, 5, pcm, expressions),
        End(3, 7200),
    ]


def main() -> None:
    """Does what the file's docstring says."""
    verb, *paths = sys.argv[1:]
    if verb == "encode":
        for i, message in enumerate(server_messages()):
            frame = encode(message)
            if isinstance(frame, str):
                Path(paths[0], f"{i}.json").write_text(frame, encoding="utf-8")
            else:
                Path(paths[0], f"{i}.bin").write_bytes(frame)
        return
    frames = [Path(p).read_bytes() for p in paths]
    texts = [f.decode() if p.endswith(".json") else f for p, f in zip(paths, frames, strict=True)]
    messages = [decode_client(frame) for frame in texts]
    print(json.dumps([asdict(m) for m in messages], default=lambda array: array.tolist()))


if __name__ == "__main__":
    main()
