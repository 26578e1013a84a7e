"""Every reader of `bench/fuzz` on a few damaged inputs; the bench itself finds what it should."""

import importlib
import mmap
import time
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.errors import CaptureError, Ico3dError

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
EXAMPLES = 4
NAMES = (
    *("video", "portrait", "synthetic", "multiview", "tracks", "DNA-Rendering", "RenderMe-360"),
    *("COLMAP", "transforms", "Gaussians", "bundle", "settings", "persona", "WAV"),
    *("model folders", "wire", "HTTP"),
)


@pytest.fixture(scope="module")
def part():
    """Gives modules of the bench by their names."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "bench")
        yield lambda name: importlib.import_module(f"fuzz.{name}")


def test_these_are_all_readers(part):
    assert tuple(reader.name for reader in part("readers").READERS) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_damaged_inputs_are_read_or_refused_in_one_sentence(part, name, tmp_path):
    (reader,) = part("readers").chosen([name])
    bench = part("reader").Bench(reader, tmp_path)

    @given(st.integers(0, 2**32 - 1))
    @settings(max_examples=EXAMPLES, derandomize=True, database=None)
    def run(seed):
        bench.run(bench.input(Random(seed)))

    run()


def write(folder):
    (folder / "a.json").write_text('{"a": 1}')


def broken(kind):
    """A reader that goes wrong in one way."""
    taken = []

    def read(folder):
        if (folder / "a.json").read_bytes() == b'{"a": 1}':
            return
        if kind == "raises":
            raise KeyError("a")
        if kind == "mumbles":
            raise CaptureError("no end")
        if kind == "hangs":
            time.sleep(60)
        if kind == "computes":
            while True:
                taken[:] = []
        if kind == "bloats":
            taken.append(b"a" * (200 << 20))
            taken.clear()
            raise CaptureError("It is too large.")

    return read


@pytest.mark.parametrize(
    ("kind", "finding"),
    [
        ("raises", "KeyError"),
        ("mumbles", "Unclear"),
        ("hangs", "hangs"),
        ("computes", "too much processor time"),
        ("bloats", "more than 50 MiB"),
    ],
)
def test_the_bench_tells_what_went_wrong(part, kind, finding):
    reader = part("reader").Reader(kind, {"a": write}, lambda: broken(kind))
    bounds = part("bounds")
    # only what is judged may be short: a busy machine takes a second to fill 200 MiB
    limits = bounds.Bounds(0.2 if kind == "computes" else 20, 0.5 if kind == "hangs" else 60, 50)
    outcome = bounds.measure(reader, range(1), 0, limits)
    (found,) = outcome.findings
    assert outcome.inputs == 1 and found.startswith(finding) and outcome.first[found] == 0


def of_a_library(folder):
    """200 MiB of a file, as libraries are."""
    library = folder / "library"
    library.write_bytes(bytes(200 << 20))
    with library.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)


def of_its_own(_):
    """200 MiB of its own, such as an allocator keeps and tells the system that it may have."""
    pages = mmap.mmap(-1, 200 << 20, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    pages.write(b"a" * len(pages))
    return pages


@pytest.mark.parametrize("mapped", [of_a_library, of_its_own])
def test_what_the_system_takes_back_meanwhile_hides_no_growth(part, tmp_path, mapped):
    with mapped(tmp_path) as pages:
        read = broken("bloats")

        def taken_back(folder):
            if (folder / "a.json").read_bytes() != b'{"a": 1}':
                pages.madvise(mmap.MADV_DONTNEED)
            return read(folder)

        def loaded():
            sum(pages[:: mmap.PAGESIZE])  # now they are resident in the process that reads
            garbage = [bytes(200 << 20)]
            garbage.append(garbage)
            return taken_back

        reader = part("reader").Reader("taken back", {"a": write}, loaded)
        bounds = part("bounds")
        outcome = bounds.measure(reader, range(1), 0, bounds.Bounds(20, 60, 50))
    assert tuple(outcome.findings) == ("more than 50 MiB",)
    assert 190 < outcome.most < 260


def test_what_was_freed_and_is_kept_for_later_hides_no_growth(part):
    blocks = [bytes(30_000) for _ in range(10_000)]
    pin = bytes(30_000)  # behind them, so that the allocator keeps their pages
    del blocks
    reader = part("reader").Reader("freed", {"a": write}, lambda: broken("bloats"))
    bounds = part("bounds")
    outcome = bounds.measure(reader, range(1), 0, bounds.Bounds(20, 60, 50))
    assert pin and tuple(outcome.findings) == ("more than 50 MiB",)
    assert 190 < outcome.most < 260


def test_a_reader_whose_sound_inputs_are_refused_is_no_measurement(part):
    def refuse(folder):
        raise Ico3dError("It is not sound.")

    reader = part("reader").Reader("refuses", {"a": write}, lambda: refuse)
    bounds = part("bounds")
    with pytest.raises(RuntimeError, match="its sound inputs are not read"):
        bounds.measure(reader, range(1), 0, bounds.Bounds(1, 1, 50))


@pytest.mark.parametrize("name", ["tracks", "bundle", "wire"])
def test_equal_seeds_make_equal_inputs(part, name, tmp_path):
    (reader,) = part("readers").chosen([name])
    one, other = (part("reader").Bench(reader, tmp_path / str(i)) for i in range(2))
    made = [part("bounds").input_of(bench, reader, 3, 14) for bench in (one, other)]
    assert made[0] == made[1]
    assert made[0] != part("bounds").input_of(one, reader, 3, 15)
