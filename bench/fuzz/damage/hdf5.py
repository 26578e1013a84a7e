"""Damages HDF5 files from within."""

import io
from random import Random

import h5py
import numpy as np

from fuzz.damage.raw import changed_bytes


def changed_hdf5(data: bytes, random: Random) -> bytes:
    """An SMC file in which one to three groups or datasets are others."""
    stream = io.BytesIO(data)
    with h5py.File(stream, "r+") as file:
        for _ in range(random.choice((1, 1, 2, 3))):
            names: list[str] = []
            file.visit(names.append)
            if names:
                _change(file, random.choice(names), random)
    return stream.getvalue()


def _change(file: h5py.File, name: str, random: Random) -> None:
    """Removes, replaces, bends or mislabels one place."""
    step, node = random.randrange(8), file[name]
    if step == 0:
        del file[name]
    elif step == 1 and node.attrs:
        node.attrs[random.choice(list(node.attrs))] = random.choice(
            (0, -1, "a", np.zeros(40), 1e300)
        )
    elif step <= 4 and isinstance(node, h5py.Dataset) and node.dtype.kind in "fiu":
        _refill(file, name, random)
    elif step == 5:
        del file[name]
        file[name] = random.choice(
            (h5py.SoftLink(f"/{name}"), h5py.SoftLink("/"), h5py.ExternalLink("/dev/zero", "x"))
        )
    elif step == 6:
        del file[name]
        _bomb(file, name, random)
    else:
        del file[name]
        file[name] = random.choice((np.zeros(0), np.zeros((2, 2, 2)), "text", 1, h5py.Empty("f8")))


def _refill(file: h5py.File, name: str, random: Random) -> None:
    """Other numbers in the same shape, another shape, or damaged bytes of a picture."""
    values = np.asarray(file[name][()])
    del file[name]
    if values.dtype == np.uint8 and values.ndim == 1:
        damaged = changed_bytes(values.tobytes(), random)
        file[name] = np.frombuffer(damaged, np.uint8)
        return
    flat = values.astype(np.float64).reshape(-1)
    if flat.size:
        flat[random.randrange(flat.size)] = random.choice((np.nan, np.inf, 1e300, -1e9, 0, 1e-300))
    shaped = random.choice((flat.reshape(values.shape), flat, flat.reshape(-1, 1), flat[:1]))
    file[name] = shaped.astype(random.choice((np.float64, np.float32, np.float16)))


def _bomb(file: h5py.File, name: str, random: Random) -> None:
    """A small dataset that claims to be large."""
    shape = random.choice(((1 << 40,), (1 << 20, 1 << 20), (300 << 20,), (100 << 20,)))
    kind = random.choice(("u1", "f8"))
    file.create_dataset(name, shape, kind, chunks=(1 << 16,) if len(shape) == 1 else (256, 256))
