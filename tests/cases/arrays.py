"""NPZ archives without NumPy, as the tests need them: numbers as nested lists, text as str."""
import ast
import struct
import zipfile


def read_npz(path):
    """Arrays by name: a scalar as number or text, others as nested lists of their shape."""
    with zipfile.ZipFile(path) as archive:
        return {name[:-4]: _read_npy(archive.read(name)) for name in archive.namelist()}


def farthest(found, wanted, frames=None, joints=None):
    """Largest difference of two arrays of one shape, over the first `frames` rows and over these entries of each row."""
    if frames is not None:
        found, wanted = found[:frames], wanted[:frames]
    if joints is not None:
        found, wanted = ([[row[joint] for joint in joints] for row in array] for array in (found, wanted))
    if not isinstance(found, list):
        return abs(found - wanted)
    if len(found) != len(wanted):
        return float("inf")
    return max((farthest(one, other) for one, other in zip(found, wanted)), default=0.0)


def _read_npy(data):
    major = data[6]
    size = struct.unpack_from("<H" if major == 1 else "<I", data, 8)[0]
    begin = 8 + (2 if major == 1 else 4)
    header = ast.literal_eval(data[begin:begin + size].decode("latin1"))
    body, kind, shape = data[begin + size:], header["descr"], header["shape"]
    count = 1
    for extent in shape:
        count *= extent
    if kind[1] == "U":
        width = 4 * int(kind[2:])
        flat = [body[i * width:(i + 1) * width].decode("utf-32-le").rstrip("\0") for i in range(count)]
    else:
        code = {"f8": "d", "f4": "f", "i8": "q", "i4": "i", "u1": "B", "b1": "?"}[kind[1:]]
        flat = list(struct.unpack_from(f"<{count}{code}", body))
    assert not header["fortran_order"] or len(shape) < 2
    for extent in reversed(shape[1:]):
        flat = [flat[i:i + extent] for i in range(0, len(flat), extent)]
    return flat if shape else flat[0]
