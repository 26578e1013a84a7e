"""The beginning of a video, its packets as they are.

Run: python short_clip.py VIDEO OUT.mp4 SECONDS
"""

import sys

import av


def main() -> None:
    """Does what the file's docstring says."""
    video, out, seconds = sys.argv[1:]
    with av.open(video) as source, av.open(out, "w") as target:
        streams = {s.index: target.add_stream_from_template(s) for s in source.streams}
        for packet in source.demux():
            if packet.dts is not None and packet.dts * packet.time_base < float(seconds):
                packet.stream = streams[packet.stream_index]
                target.mux(packet)


if __name__ == "__main__":
    main()
