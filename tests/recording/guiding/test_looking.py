"""Parts are looked at by processes that end where a part takes too much, without a tracker."""

import asyncio

import pytest

from ico3d.errors import CaptureError
from ico3d.recording.guiding import looking
from ico3d.recording.guiding.looking import Looks
from ico3d.recording.guiding.seeing import Eye
from ico3d.recording.refusals import Refused
from support.needs import needs
from support.strangers.empty_pictures import write_empty_pictures
from support.studio_page.parts import part_file

pytestmark = [needs("av"), needs("cv2"), pytest.mark.slow]


@pytest.fixture(autouse=True)
def blind(tmp_path, monkeypatch):
    """A machine without models."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)


@pytest.fixture
def costly(tmp_path, monkeypatch):
    """A film of 150 kB that would take half a minute of processor time, where a second is had."""
    monkeypatch.setattr(looking, "SECONDS", 0.5)  # or what is left of a second
    monkeypatch.setattr(looking, "SECONDS_PER_MEGABYTE", 0.0)
    write_empty_pictures(tmp_path / "costly.mkv", 400)
    assert (tmp_path / "costly.mkv").stat().st_size < 160_000
    return tmp_path / "costly.mkv"


@pytest.mark.parametrize("id", ["left", "upload", "consent"])
async def test_what_is_found_is_told_as_it_was_found(tmp_path, id):
    file = part_file(tmp_path / "a.mp4")
    assert await Looks().report(file, id) == Eye().report(file, id)


async def test_what_is_refused_is_told_with_its_advice(tmp_path):
    mute = part_file(tmp_path / "mute.mp4", sound=False)
    with pytest.raises(Refused, match="the video has no sound") as refused:
        await Looks().report(mute, "upload")
    with pytest.raises(Refused) as expected:
        Eye().report(mute, "upload")
    told, meant = refused.value, expected.value
    assert (told.code, told.status, str(told)) == (meant.code, meant.status, str(meant))
    assert [str(one) for one in told.advice] == [str(one) for one in meant.advice]
    with pytest.raises(Refused) as refused:
        await Looks().report(tmp_path / "deleted.mp4", "left")
    assert refused.value.code == "unknown"


@pytest.mark.parametrize("id", ["left", "upload"])
async def test_a_film_whose_pictures_take_too_long_ends_the_look(costly, id):
    with pytest.raises(Refused, match="more time or memory") as refused:
        await Looks().report(costly, id)
    assert (refused.value.code, refused.value.status) == ("costly", 422)


async def test_a_part_that_fills_the_memory_ends_the_look(tmp_path, monkeypatch):
    write_empty_pictures(tmp_path / "large.mkv", 3)
    assert (await Looks().report(tmp_path / "large.mkv", "left"))["seconds"] > 0
    monkeypatch.setattr(looking, "MOST_BYTES", 100 << 20)
    with pytest.raises(Refused):
        await Looks().report(tmp_path / "large.mkv", "left")


async def test_no_look_goes_on_beyond_the_end_nor_is_its_part_at_fault(costly, monkeypatch):
    monkeypatch.setattr(looking, "SECONDS", 60.0)
    looks = Looks()
    going = [asyncio.create_task(looks.report(costly, "left")) for _ in range(2)]
    while len(looks._running) < 2:
        await asyncio.sleep(0.01)
    await asyncio.to_thread(looks.close)
    going.append(asyncio.create_task(looks.report(costly, "left")))
    for told in await asyncio.gather(*going, return_exceptions=True):
        assert isinstance(told, CaptureError) and not isinstance(told, Refused)
    assert not looks._running


async def test_what_is_gone_is_looked_at_no_longer(costly, monkeypatch):
    """Only where it was; and nobody hears that it took too much."""
    monkeypatch.setattr(looking, "SECONDS", 60.0)
    looks = Looks()
    going = asyncio.create_task(looks.report(costly, "left"))
    while not looks._running:
        await asyncio.sleep(0.01)
    await asyncio.to_thread(looks.end, costly.parent / "another")
    await asyncio.sleep(0.2)
    assert looks._running
    costly.unlink()
    await asyncio.to_thread(looks.end, costly.parent)
    with pytest.raises(Refused) as refused:
        await asyncio.wait_for(going, 10)
    assert refused.value.code == "unknown" and not looks._running


async def test_a_process_that_fails_is_no_fault_of_the_part(tmp_path, monkeypatch):
    monkeypatch.setattr(looking, "LOOK", "ico3d.nowhere")
    with pytest.raises(CaptureError, match="has failed"):
        await Looks().report(part_file(tmp_path / "a.mp4"), "left")
