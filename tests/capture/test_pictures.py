"""Pictures that are kept, read again, or read in advance."""

import threading

import numpy as np
import pytest

from ico3d.capture.pictures import LayerCache, View, read_in_turn
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError

CAMERA = Camera(2, 2, np.eye(3), np.eye(4))


class Reader:
    """Layers of one value, and who read them."""

    def __init__(self):
        self.read: list[tuple[int, int]] = []
        self.threads: set[int] = set()
        self.gate = threading.Event()
        self.gate.set()

    def __call__(self, camera, frame):
        assert self.gate.wait(10)
        self.threads.add(threading.get_ident())
        self.read.append((camera, frame))
        if frame == 9:
            raise CaptureError("frame 9 is damaged.")
        return None if frame == 8 else (np.full((2, 2, 3), frame / 10, np.float32), None)


def views(*frames):
    return [View(0, frame, CAMERA) for frame in frames]


@pytest.mark.parametrize("gib", [0.0, 1.0])
def test_what_is_expected_is_read_once_by_others(gib):
    reader = Reader()
    cache = LayerCache(reader, gib)
    cache.expect(views(1, 2, 3))
    cache.expect(views(2, 3, 4))
    found = [cache.layers(0, frame) for frame in (1, 2, 3, 4)]
    assert [layers[0][0, 0, 0] for layers in found] == [26, 51, 77, 102]
    assert sorted(reader.read) == [(0, frame) for frame in (1, 2, 3, 4)]
    assert threading.get_ident() not in reader.threads


def test_nobody_waits_until_it_is_needed():
    reader = Reader()
    reader.gate.clear()
    cache = LayerCache(reader, 1.0)
    cache.expect(views(1))  # comes back, though reading cannot go on
    assert reader.read == []
    reader.gate.set()
    assert cache.layers(0, 1) is not None and cache.layers(0, 1) is not None
    assert reader.read == [(0, 1)]


def test_what_is_not_kept_is_read_at_each_use():
    reader = Reader()
    cache = LayerCache(reader, 0.0)
    assert cache.layers(0, 1) is not None and cache.layers(0, 1) is not None
    cache.expect(views(1))
    assert cache.layers(0, 1) is not None
    assert reader.read == [(0, 1)] * 3


def test_missing_and_damaged_pictures_are_told_where_they_are_used():
    cache = LayerCache(Reader(), 1.0)
    cache.expect(views(8, 9, 1))
    assert cache.layers(0, 1) is not None
    assert cache.layers(0, 8) is None
    with pytest.raises(CaptureError, match="frame 9 is damaged"):
        cache.layers(0, 9)


def test_frames_come_in_turn_whoever_reads_first():
    reader = Reader()

    def read(frame):
        layers = reader(0, frame)
        return layers and layers[0]

    found = [
        (frame, None if p is None else p[0, 0, 0]) for frame, p in read_in_turn(read, [5, 8, 1])
    ]
    assert found == [(5, np.float32(0.5)), (8, None), (1, np.float32(0.1))]
    with pytest.raises(CaptureError, match="frame 9"):
        list(read_in_turn(read, [1, 9, 2]))
