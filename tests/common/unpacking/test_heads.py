"""Heads of safetensors files that would take much memory."""

import json

import numpy as np
import pytest
from safetensors.numpy import save_file

from ico3d.common.unpacking import heads
from ico3d.common.unpacking.heads import check_head


def test_heads_of_models_are_taken(tmp_path):
    save_file({f"t{n}": np.zeros(3, np.float32) for n in range(50)}, tmp_path / "a.safetensors")
    check_head(tmp_path / "a.safetensors")


def test_a_head_of_many_tensors_or_without_an_end_is_refused(tmp_path):
    entry = {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}
    head = json.dumps({str(n): entry for n in range(heads.MOST_TENSORS + 1)}).encode()
    many, long = tmp_path / "many.safetensors", tmp_path / "long.safetensors"
    many.write_bytes(len(head).to_bytes(8, "little") + head)
    long.write_bytes((heads.MOST_HEAD + 1).to_bytes(8, "little"))
    for file in (many, long):
        with pytest.raises(ValueError, match="larger than those of models"):
            check_head(file)
