"""Heads of safetensors files that would take much memory."""

import os

import numpy as np
import pytest
from safetensors.numpy import save_file

from ico3d.common.unpacking import heads
from ico3d.common.unpacking.heads import check_head, load_bounded
from support.strangers.claimed import write_crowded


def test_heads_of_models_are_taken(tmp_path):
    save_file({f"t{n}": np.zeros(3, np.float32) for n in range(50)}, tmp_path / "a.safetensors")
    check_head(tmp_path / "a.safetensors")
    assert len(load_bounded((tmp_path / "a.safetensors").read_bytes())) == 50


def test_a_file_that_is_a_hole_is_refused(tmp_path):
    path = tmp_path / "hole.safetensors"
    save_file({"a": np.zeros(1, np.float32)}, path)
    stored = 512 * path.stat().st_blocks
    os.truncate(path, heads.MOST_RATIO * stored + heads.FREE)
    check_head(path)
    os.truncate(path, heads.MOST_RATIO * stored + heads.FREE + 1)
    with pytest.raises(ValueError, match=r"it claims \d+ times what the disk stores of it"):
        check_head(path)


def test_a_head_of_many_tensors_or_without_an_end_is_refused(tmp_path):
    many, long = tmp_path / "many.safetensors", tmp_path / "long.safetensors"
    write_crowded(many)
    long.write_bytes((heads.MOST_HEAD + 1).to_bytes(8, "little"))
    for file in (many, long):
        for read in (check_head, lambda file: load_bounded(file.read_bytes())):
            with pytest.raises(ValueError, match="larger than those of models"):
                read(file)


@pytest.mark.parametrize(
    "entry",
    ['{"d\\u0074ype":"U8","shape":[0],"data_offsets":[0,0]}', '["U8",[0],[0,0]]'],
    ids=["an escaped word", "no words"],
)
def test_many_tensors_are_refused_however_their_heads_are_written(entry):
    """The library reads both as it reads others."""

    def written(count: int) -> bytes:
        head = "{" + ",".join(f'"{n}":{entry}' for n in range(count)) + "}"
        return len(head).to_bytes(8, "little") + head.encode()

    assert len(load_bounded(written(3))) == 3
    with pytest.raises(ValueError, match="larger than those of models"):
        load_bounded(written(heads.MOST_TENSORS + 1))
