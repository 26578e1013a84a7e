"""What both ends of a remote expression server know (`/v1/expressions`).

The server says `{"model": sha256, "rate": 24000, "fps": 25, "size": C}`. The text frame `start`
begins a sound. Every binary frame (PCM16, mono, little-endian, at most 64 KiB) is answered by one
binary frame with the rows known now ((n, C) float32, little-endian, n may be 0), and the text
frame `finish` by the rows that are left.
"""

import numpy as np

PATH = "/v1/expressions"
START, FINISH = "start", "finish"
ROW = np.dtype("<f4")
