"""Pictures that are kept, read again, or read in advance."""

import threading
import time

import numpy as np
import pytest

from ico3d.capture.pictures import View
from ico3d.capture.reading import memory
from ico3d.capture.reading.layer_cache import AHEAD, QUEUED, LayerCache, read_in_turn
from ico3d.capture.reading.spill import Spill
from ico3d.common.camera import Camera
from ico3d.common.files import SPARE
from ico3d.errors import CaptureError, SettingsError
from support.full_disk import files_of_at_most

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
        return None if frame == 8 else (np.full((2, 2, 3), frame, np.uint8), None)


def views(*frames):
    return [View(0, frame, CAMERA) for frame in frames]


def expect(cache, *frames):
    """One step for each frame."""
    cache.expect(range(len(frames)), lambda step: views(*frames)[step])


@pytest.mark.parametrize("gib", [0.0, 1.0, "auto"])
def test_what_is_expected_is_read_once_by_others(gib):
    reader = Reader()
    cache = LayerCache(reader, gib)
    steps = views(1, 2, 3, 4)
    found = []
    for index, view in enumerate(steps):
        cache.expect(range(index, len(steps)), steps.__getitem__)
        found.append(cache.layers(0, view.frame)[0][0, 0, 0])
    assert found == [1, 2, 3, 4]
    assert sorted(reader.read) == [(0, frame) for frame in (1, 2, 3, 4)]
    assert threading.get_ident() not in reader.threads


def test_nobody_waits_until_it_is_needed():
    reader = Reader()
    reader.gate.clear()
    cache = LayerCache(reader, 1.0)
    expect(cache, 1)  # comes back, though reading cannot go on
    assert reader.read == []
    reader.gate.set()
    assert cache.layers(0, 1) is not None and cache.layers(0, 1) is not None
    assert reader.read == [(0, 1)]


def test_what_is_not_kept_is_read_at_each_use():
    reader = Reader()
    cache = LayerCache(reader, 0.0)
    assert cache.layers(0, 1) is not None and cache.layers(0, 1) is not None
    expect(cache, 1)
    assert cache.layers(0, 1) is not None
    assert reader.read == [(0, 1)] * 3


def test_all_that_memory_keeps_is_read_ahead_and_no_more():
    steps = [View(0, step + 10, CAMERA) for step in range(200)]
    for gib, ahead in ((1.0, 100), (0.0, AHEAD), (30 * 12 / 2**30, 30)):
        reader = Reader()
        cache = LayerCache(reader, gib)
        assert cache.layers(0, steps[0].frame) is not None  # tells how large they are
        for _ in range(100):  # as if a step lasted until its pictures were read
            cache.expect(range(1, 101), steps.__getitem__)
            while len(reader.read) <= len(cache._coming):
                time.sleep(0.001)
        assert abs(len(reader.read) - ahead) <= 2, gib


def test_a_training_that_ends_reads_few_pictures_more():
    reader = Reader()
    cache = LayerCache(reader, 1.0)
    assert cache.layers(0, 1) is not None
    reader.gate.clear()
    cache.expect(range(1000), lambda step: View(0, step + 10, CAMERA))
    reader.gate.set()
    cache._readers.shutdown()
    assert len(reader.read) == 1 + QUEUED


def test_what_does_not_fit_in_memory_is_read_once_and_kept_on_a_disk(tmp_path):
    reader = Reader()
    cache = LayerCache(reader, 2 * 12 / 2**30, str(tmp_path / "cache"))
    for _ in range(3):
        found = [cache.layers(0, frame) for frame in (1, 2, 3, 4)]
        assert [layers[0][1, 1, 2] for layers in found] == [1, 2, 3, 4]
        assert all(layers[1] is None and layers[0].shape == (2, 2, 3) for layers in found)
    assert reader.read == [(0, frame) for frame in (1, 2, 3, 4)]
    assert list((tmp_path / "cache").iterdir()) == []  # a killed run leaves nothing


def test_a_full_disk_of_the_cache_is_no_end(tmp_path, caplog):
    cache = LayerCache(Reader(), 0.0, str(tmp_path))
    with files_of_at_most(20):
        for _ in range(2):
            assert [cache.layers(0, f)[0][0, 0, 0] for f in (1, 2, 3)] == [1, 2, 3]
    assert [r.message for r in caplog.records].count(caplog.records[0].message) == 1
    assert "The disk of --cache-dir is full" in caplog.text


def test_the_cache_leaves_room_on_its_disk(tmp_path, caplog, monkeypatch):
    reader = Reader()
    cache = LayerCache(reader, 0.0, str(tmp_path))
    left = [SPARE + 12, SPARE + 11]  # the second picture of 12 bytes does not fit any more
    monkeypatch.setattr(Spill, "_free", lambda _: left.pop(0))
    for _ in range(2):
        assert [cache.layers(0, f)[0][0, 0, 0] for f in (1, 2, 3)] == [1, 2, 3]
    assert reader.read == [(0, 1), (0, 2), (0, 3), (0, 2), (0, 3)]
    assert "The disk of --cache-dir is full" in caplog.text


def test_a_cache_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SettingsError, match=r"--cache-dir .* cannot be written to"):
        LayerCache(Reader(), 0.0, str(tmp_path / "file"))


def test_missing_and_damaged_pictures_are_told_where_they_are_used():
    cache = LayerCache(Reader(), 1.0)
    expect(cache, 8, 9, 1)
    assert cache.layers(0, 1) is not None
    assert cache.layers(0, 8) is None
    with pytest.raises(CaptureError, match="frame 9 is damaged"):
        cache.layers(0, 9)


def test_training_goes_on_without_few_pictures(caplog):
    cache, shown = LayerCache(Reader(), 1.0), views(9, *range(10, 60), 9, 8)
    assert cache.readable(shown, 1).frame == 10
    assert cache.readable(shown, 0).frame == 10
    assert cache.readable(shown, 51).frame == 10  # frame 9 again, then the one that has vanished
    assert len(caplog.records) == 2
    assert "frame 9 is damaged. Training goes on without" in caplog.text
    assert "frame 8 by camera 0 has vanished" in caplog.text
    cache = LayerCache(Reader(), 1.0)
    with pytest.raises(CaptureError, match=r"2 of 3 pictures cannot be read.*mend"):
        cache.readable(views(9, 8, 1), 0)


def test_processes_that_share_memory_leave_some_of_it(monkeypatch):
    budgets = [memory.Budget("auto") for _ in range(3)]
    monkeypatch.setattr(
        memory, "free_memory", lambda: 1000 - sum(budget.used for budget in budgets)
    )
    for _ in range(100):
        for budget in budgets:
            budget.take(10)
    assert 600 <= sum(budget.used for budget in budgets) <= 750
    alone = memory.Budget(100 / 2**30)
    assert alone.take(60) and not alone.take(60) and alone.take(40) and alone.left() == 0


def test_frames_come_in_turn_whoever_reads_first():
    reader = Reader()

    def read(frame):
        layers = reader(0, frame)
        return layers and layers[0]

    found = [
        (frame, None if p is None else p[0, 0, 0]) for frame, p in read_in_turn(read, [5, 8, 1])
    ]
    assert found == [(5, 5), (8, None), (1, 1)]
    with pytest.raises(CaptureError, match="frame 9"):
        list(read_in_turn(read, [1, 9, 2]))
