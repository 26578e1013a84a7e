"""Notices of sources come from files that anybody may have written."""

import os

import pytest

from ico3d.avatar.baking.command import Bake
from ico3d.common.files import MOST_NOTES
from ico3d.errors import SettingsError


def notices(tmp_path, *files):
    return Bake(tmp_path, (tmp_path / "out.ico3d",), licences=files)._notices()


def test_notices_stand_one_after_the_other(tmp_path):
    first, second = tmp_path / "a.txt", tmp_path / "b.txt"
    first.write_text("MIT\n")
    second.write_text("CC0, “as is”\n", encoding="utf-8")
    assert notices(tmp_path, first, second) == "MIT\n\nCC0, “as is”"


def test_a_notice_that_is_no_small_text_is_refused_in_a_sentence(tmp_path):
    hole, pipe, latin = (tmp_path / name for name in ("hole", "pipe", "latin"))
    with hole.open("wb") as file:
        file.truncate(MOST_NOTES + 1)
    os.mkfifo(pipe)
    latin.write_bytes("Größe".encode("latin-1"))
    for file in (hole, pipe, latin, tmp_path / "nothing"):
        with pytest.raises(SettingsError, match="a notice of --licences cannot be read"):
            notices(tmp_path, file)
