"""Files that claim gigabytes and take no room on a disk."""

import json
from pathlib import Path


def write_claim(file: Path, name: str, numbers: int) -> None:
    """Writes safetensors of one tensor of so many zeros, of which the disk holds nothing."""
    entry = {"dtype": "F32", "shape": [numbers], "data_offsets": [0, 4 * numbers]}
    head = json.dumps({name: entry}).encode()
    with file.open("wb") as opened:
        opened.write(len(head).to_bytes(8, "little") + head)
        opened.truncate(8 + len(head) + 4 * numbers)
