"""The protocol of remote expression modules (`/v1/expressions`), for client and server.

The server first sends `{"model": sha256, "rate": 24000, "fps": 25, "size": C}`. The text frame
`start` begins a sound. The server answers every binary frame (PCM16, mono, little-endian, at most
64 KiB) with one binary frame that contains the rows known so far ((n, C) float32, little-endian, n
may be 0), and the text frame `finish` with the remaining rows. It closes with 1008 where far more
messages come than sound needs, or some in a row without sound: `start` or `finish` right
after `start`, and empty frames. After `finish` comes `start`.
"""

import numpy as np

PATH = "/v1/expressions"
START, FINISH = "start", "finish"
ROW = np.dtype("<f4")
