"""What tells the files of a recording from others."""

from ico3d.recording.making.sources import signature


def test_a_part_that_is_recorded_anew_meanwhile_is_no_error(tmp_path):
    """Its earlier take goes as soon as the new one is kept, if that is another kind of video."""
    for name in ("left.webm", "text-1.webm"):
        tmp_path.joinpath(name).write_bytes(b"seen")
    files = sorted(tmp_path.iterdir())
    both = signature(files)
    files[0].unlink()
    assert signature(files) == both[1:]
