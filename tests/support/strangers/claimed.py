"""Files that claim more than they hold, or hold more than anybody needs."""

import json
from pathlib import Path

from ico3d.common.unpacking.heads import MOST_TENSORS


def write_claim(file: Path, name: str, numbers: int) -> None:
    """Writes safetensors of one tensor of so many zeros, of which the disk holds nothing."""
    entry = {"dtype": "F32", "shape": [numbers], "data_offsets": [0, 4 * numbers]}
    head = json.dumps({name: entry}).encode()
    with file.open("wb") as opened:
        opened.write(len(head).to_bytes(8, "little") + head)
        opened.truncate(8 + len(head) + 4 * numbers)


def write_crowded(file: Path) -> None:
    """Writes safetensors of more empty tensors than are read, which take a kilobyte each."""
    entry = {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}
    head = json.dumps({str(n): entry for n in range(MOST_TENSORS + 1)}).encode()
    file.write_bytes(len(head).to_bytes(8, "little") + head)
