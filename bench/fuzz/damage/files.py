"""Damages a folder of sound files, each by its own form."""

import json
import tomllib
from random import Random

from fuzz.damage.containers import (
    changed_gzip,
    changed_npy,
    changed_png,
    changed_safetensors,
    changed_wav,
    changed_zip,
)
from fuzz.damage.hdf5 import changed_hdf5
from fuzz.damage.network import changed_frame, changed_request
from fuzz.damage.raw import changed_bytes, changed_lines
from fuzz.damage.values import changed_tree, json_text, toml_text

Files = dict[str, bytes]
"""Contents by path below a folder."""
FORMS = {
    "safetensors": changed_safetensors,
    "smc": changed_hdf5,
    "png": changed_png,
    "npy": changed_npy,
    "wav": changed_wav,
    "frame": changed_frame,
    "http": changed_request,
    **dict.fromkeys(("txt", "csv", "lms"), changed_lines),
}
"""What keeps the form of a file, by its suffix."""


def damaged(files: Files, random: Random) -> Files:
    """Files of which one or two are damaged, missing, empty, or another's content."""
    changed = dict(files)
    for _ in range(random.choice((1, 1, 1, 2))):
        name = random.choice(list(changed))
        step = random.randrange(20) if len(files) > 1 else 4
        if step == 0:
            del changed[name]
        elif step == 1:
            changed[name] = b""
        elif step == 2:
            changed[name] = files[random.choice(list(files))]
        else:
            changed[name] = damaged_file(name, changed[name], random)
        if not changed:
            return changed
    return changed


def damaged_file(name: str, data: bytes, random: Random) -> bytes:
    """One damaged file: in a third of cases as bytes, else as what it is."""
    if random.random() < 0.3 or not data:
        return changed_bytes(data, random)
    try:
        return _by_form(name.rpartition(".")[2], data, random)
    except Exception:  # it is no longer of its form, so that this is its second damage
        return changed_bytes(data, random)


def _by_form(suffix: str, data: bytes, random: Random) -> bytes:
    """Damage that keeps the form of a file."""
    if data[:4] == b"PK\3\4":
        return changed_zip(data, random, damaged_file)
    if data[:2] == b"\x1f\x8b":
        return changed_gzip(data, random)
    if suffix == "json":
        return json_text(changed_tree(json.loads(data), random), random)
    if suffix == "toml":
        return toml_text(changed_tree(tomllib.loads(data.decode()), random))
    return FORMS.get(suffix, changed_bytes)(data, random)
