"""Weights that someone has packed are not unpacked: torch would do so without a bound."""

import pickle
import tarfile
import zipfile
from collections import OrderedDict

import pytest
import torch
from safetensors.torch import save_file

from ico3d.common.unpacking.pickles import MOST_STEPS
from ico3d.common.unpacking.weights import check_unpacked, load_weights
from ico3d.errors import ModelError
from ico3d.measure.sync.network import load_state
from ico3d.speech.encoder import load_ave
from ico3d.speech.hubert import load_network
from support.needs import needs

pytestmark = pytest.mark.slow


def packed(path, kind=zipfile.ZIP_DEFLATED):
    """A file of weights, packed by another program."""
    torch.save({"audio_encoder.x": torch.zeros(1 << 20)}, path.with_suffix(".whole"))
    with (
        zipfile.ZipFile(path.with_suffix(".whole")) as whole,
        zipfile.ZipFile(path, "w", kind) as archive,
    ):
        for name in whole.namelist():
            archive.writestr(name, whole.read(name))
    return path


@pytest.mark.filterwarnings("ignore")
def test_packed_weights_are_refused_wherever_they_are_read(tmp_path):
    file = packed(tmp_path / "a.pth")
    assert file.stat().st_size < 20_000
    for read in (
        lambda: load_weights(file),
        lambda: load_ave(file),
        lambda: load_state(torch.nn.Linear(1, 1), file),
    ):
        with pytest.raises(ModelError, match="is packed, as no file is that PyTorch writes"):
            read()


@needs("transformers")
def test_hubert_is_not_unpacked(tmp_path):
    (tmp_path / "config.json").write_text('{"model_type": "hubert"}')
    packed(tmp_path / "pytorch_model.bin")
    with pytest.raises(ModelError, match="is packed"):
        load_network(tmp_path)


@needs("transformers")
def test_hubert_as_safetensors_is_no_pickle(tmp_path):
    (tmp_path / "config.json").write_text('{"model_type": "hubert"}')
    save_file({"x": torch.zeros(1)}, tmp_path / "model.safetensors")
    with pytest.raises(ModelError, match="does not hold HuBERT: it lacks"):
        load_network(tmp_path)
    many = {f"{i}": torch.zeros(0) for i in range(10_001)}
    save_file(many, tmp_path / "model.safetensors")
    with pytest.raises(ModelError, match="its head is larger than those of models"):
        load_network(tmp_path)


def test_parts_that_overlap_are_refused(tmp_path):
    file = packed(tmp_path / "a.pth", zipfile.ZIP_STORED)
    check_unpacked(file)
    data, sign = bytearray(file.read_bytes()), b"PK\1\2"
    with zipfile.ZipFile(file) as archive:
        parts = archive.infolist()
    large = max(parts, key=lambda part: part.file_size)
    place = data.index(sign)
    for _ in parts:  # each becomes the large one
        data[place + 20 : place + 28] = large.file_size.to_bytes(4, "little") * 2
        data[place + 42 : place + 46] = large.header_offset.to_bytes(4, "little")
        place = data.find(sign, place + 4)
    file.write_bytes(data)
    with pytest.raises(ModelError, match="is packed"):
        check_unpacked(file)


@pytest.mark.parametrize("old", [False, True])
def test_what_torch_writes_is_read(tmp_path, old):
    torch.save({"x": torch.arange(5)}, tmp_path / "a.pth", _use_new_zipfile_serialization=not old)
    assert load_weights(tmp_path / "a.pth")["x"].tolist() == [0, 1, 2, 3, 4]


def test_a_damaged_archive_is_one_sentence(tmp_path):
    (tmp_path / "a.pth").write_bytes(b"PK\3\4" + bytes(50))
    with pytest.raises(ModelError, match="damaged file of weights"):
        load_weights(tmp_path / "a.pth")


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("made", [b"}", b"\x8f"])
def test_a_file_of_nothing_but_objects_is_not_read(tmp_path, old, made):
    """A megabyte of empty sets becomes 235 of memory."""
    file, many = tmp_path / "a.pth", b"\x80\x04](" + made * (MOST_STEPS + 1) + b"e."
    if old:
        file.write_bytes(
            b"".join(pickle.dumps(part, 2) for part in (0x1950A86A20F9469CFC6C, 1001, {})) + many
        )
    else:
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("archive/data.pkl", many)
    with pytest.raises(ModelError, match="more objects than a file of weights"):
        load_weights(file)


def archive_of(path, pickled, name="archive/data.pkl"):
    """A file of weights whose objects are these."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, pickled)
    return path


@pytest.mark.parametrize("module", ["builtins", "__builtin__"])
@pytest.mark.parametrize("how", ["by name", "by words"])
def test_nothing_is_made_of_a_number_alone(tmp_path, module, how):
    """389 bytes became as many gigabytes as they said: `bytearray` is a name that torch permits."""
    if how == "by name":
        named = f"c{module}\nbytearray\n".encode()
    else:
        named = b"\x8c" + bytes([len(module)]) + module.encode() + b"\x8c\tbytearray\x93"
    file = archive_of(tmp_path / "a.pt", b"\x80\x04" + named + b"J\0\0\0\x10\x85R.")
    with pytest.raises(ModelError, match="no file of weights"):
        load_weights(file)


ORDERED, SIZE = b"ccollections\nOrderedDict\n", b"ctorch\nSize\n"
NUMBERS, KEY = b"ctorch\nFloatStorage\n", b"X\1\0\0\x000X\3\0\0\0cpu"
STORED = b"X\7\0\0\0storage" + NUMBERS + KEY
MANY = b"](" + b"".join(b"K" + bytes([i]) + b"N\x86" for i in range(100)) + b"e"


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        (MANY + b"q\1" + ORDERED + b"h\1\x85R", "copies a dictionary"),
        (ORDERED + b")R}(" + b"K\1N" * 100 + b"ub", "another state"),
        (b"(" + b"K\1" * 100 + b"tq\1" + SIZE + b"h\1\x85R", "more axes"),
        (MANY + b"q\1" + SIZE + b"h\1\x85R", "more axes"),
        (b"ctorch\nFloatStorage\nJ\0\0\0\x10\x85R", "calls 'torch FloatStorage'"),
        (b"ctorch.nn.parameter\nParameter\n)\x81", "NEWOBJ"),
        (b"}))" + b"q\1h\1\x86" * 30 + b"Ns", "a key is a tuple"),
        (b"R", "do not fit"),
        (b"K\0Q", "no kind that weights have"),
        (b"(" + STORED + b"J\xff\xff\xff\x7ftQ", "more numbers"),
        (b"K\1K\1a", "do not fit"),
    ],
)
def test_nothing_is_copied_or_made_but_tensors(tmp_path, steps, words):
    """200 kB copied a list of theirs until 8 GB were full; keys of keys are never at their end."""
    file = archive_of(tmp_path / "a.pt", b"\x80\x02](" + steps + b"e.")
    with pytest.raises(ModelError, match=words):
        load_weights(file)


@pytest.mark.parametrize("old", [False, True])
def test_trainings_are_read(tmp_path, old):
    network = torch.nn.Sequential(torch.nn.Conv1d(2, 3, 3), torch.nn.BatchNorm1d(3))
    optimiser = torch.optim.AdamW(network.parameters())
    network(torch.randn(2, 2, 8)).sum().backward()
    optimiser.step()
    state = {
        "network": network.state_dict(),
        "optimiser": optimiser.state_dict(),
        "size": torch.Size([3, 4]),
        "kind": torch.float16,
        "place": torch.device("cpu"),
        "parameter": torch.nn.Parameter(torch.ones(2)),
        "settings": {"steps": 1 << 70, "rate": 0.1, "names": ("a", None, True)},
    }
    file = tmp_path / "a.pth"
    torch.save(state, file, _use_new_zipfile_serialization=not old)
    read = load_weights(file)
    assert read["network"].keys() == network.state_dict().keys()
    assert read["network"]._metadata == network.state_dict()._metadata
    assert read["settings"] == state["settings"] and read["size"] == (3, 4)
    optimiser.load_state_dict(read["optimiser"])


@pytest.mark.parametrize(
    ("storage", "offset", "size", "stride"),
    [
        (16, 0, (17,), (1,)),
        (16, 0, (10**9,), (0,)),
        (16, 1, (4, 4), (4, 1)),
        (16, -1, (1,), (1,)),
        (16, 0, (1,) * 65, (1,) * 65),
        (16, 0, (4,), (4, 1)),
        (16, 0, (2, 2), (1, "1")),
    ],
)
def test_a_tensor_is_no_larger_than_its_numbers(tmp_path, storage, offset, size, stride):
    """196 bytes had torch make room for 3 GB of them."""

    class Told:
        def __reduce__(self):
            numbers = torch.arange(storage, dtype=torch.float32)._typed_storage()
            more = (False, OrderedDict())
            return torch._utils._rebuild_tensor_v2, (numbers, offset, size, stride, *more)

    file = tmp_path / "a.pt"
    torch.save({"x": Told()}, file)
    with pytest.raises(ModelError, match=r"tensor|axes"):
        load_weights(file)


def test_numbers_that_are_named_anew_count_anew(tmp_path):
    """Names that differ in their case were read again and again: 4 MB took 2.5 GB."""
    once = b"(X\7\0\0\0storage" + NUMBERS
    many = b"".join(
        once + b"X\4\0\0\0" + name + b"X\3\0\0\0cpuM\0\2tQ" for name in (b"abcd", b"Abcd", b"aBcd")
    )
    file = archive_of(tmp_path / "a.pt", b"\x80\x02](" + many + b"e.")
    with pytest.raises(ModelError, match="names more numbers than it has"):
        load_weights(file)


def hole(path, head, size):
    with path.open("wb") as file:
        file.write(head)
        file.truncate(size)
    return path


def test_a_hole_is_not_gone_through(tmp_path):
    """4 kB of a disk that say they are a text of 2 GB."""
    text = b"X" + (2_000_000_000).to_bytes(4, "little")
    for head in (b"\x80\x02" + text, pickle.dumps(0x1950A86A20F9469CFC6C, 2) + b"\x80\x02" + text):
        file = hole(tmp_path / "a.pt", head, 2_000_000_100)
        with pytest.raises(ModelError, match="damaged file of weights"):
            load_weights(file)


@pytest.mark.parametrize("kind", [tarfile.GNUTYPE_LONGNAME, tarfile.XHDTYPE, tarfile.REGTYPE])
def test_a_file_that_is_a_tar_as_well_is_refused(tmp_path, kind):
    """torch would read the whole of a first member, 2 GB, before anything else."""
    member = tarfile.TarInfo(pickle.dumps(0x1950A86A20F9469CFC6C, 2).decode("latin1"))
    member.size, member.type = 2_000_000_000, kind
    file = hole(tmp_path / "a.pt", member.tobuf(tarfile.GNU_FORMAT, "latin1"), 2_000_001_024)
    with pytest.raises(ModelError, match="two kinds of files"):
        load_weights(file)


def test_objects_are_counted_whatever_the_case_of_their_name(tmp_path):
    many = b"\x80\x04](" + b"}" * (MOST_STEPS + 1) + b"e."
    file = archive_of(tmp_path / "a.pt", many, "archive/DATA.PKL")
    with pytest.raises(ModelError, match="more objects"):
        load_weights(file)
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("archive/data.pkl", b"\x80\x02}.")
    with pytest.raises(ModelError, match="two parts of one name"):
        load_weights(file)


def test_an_archive_whose_directory_is_elsewhere_is_refused(tmp_path):
    """Of two directories torch read the one that was not looked at."""
    torch.save({"x": torch.zeros(3)}, tmp_path / "a.pth")
    (tmp_path / "b.pth").write_bytes(b"PK\3\4" + (tmp_path / "a.pth").read_bytes())
    with pytest.raises(ModelError, match="its directory is not where it should be"):
        load_weights(tmp_path / "b.pth")


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.int64, torch.bool])
def test_every_kind_of_number_is_read(tmp_path, dtype):
    layer = torch.nn.Linear(2, 2)
    held = {"x": torch.ones(3).to(dtype), "layer": layer.state_dict(), "own": layer.weight}
    torch.save(held, tmp_path / "a.pth")
    assert load_weights(tmp_path / "a.pth")["x"].dtype == dtype
