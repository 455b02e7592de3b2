"""Writes onnx_policy.onnx, the network of onnx_policy.yaml: `python3 make_onnx_policy.py [FILE]`. Standard library only.

The robot stands where it is; while the partner is near and the task is a wave or a high-five it raises its right arm.
A network of yours comes from your own framework's export; this file shows the smallest one that duet can run.
"""
import struct
import sys

JOINTS = 29
ANCHOR = 7 + JOINTS  # root position, quaternion wxyz, joints from the neutral pose
ANCHORS = 5
SHOULDER_PITCH, SHOULDER_ROLL, ELBOW = 22, 23, 25  # of the right arm in the order of onnx_policy.yaml
TASKS = 6  # hug, handshake, high_five, wave, bend, fly_kiss
NEAR = 2.5  # [m]


def varint(value):
    out = b""
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def field(number, value):
    """A field of a protobuf message: an integer, or bytes and text with their length."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def tensor(name, shape, values, whole=False):
    data = struct.pack("<%d%s" % (len(values), "q" if whole else "f"), *values)
    dims = b"".join(field(1, size) for size in shape)
    return dims + field(2, 7 if whole else 1) + field(8, name) + field(9, data)


def node(op, inputs, output):
    return b"".join(field(1, name) for name in inputs) + field(2, output) + field(4, op)


def shaped(name, shape):
    dims = b"".join(field(1, field(1, size)) for size in shape)
    return field(1, name) + field(2, field(1, field(1, 1) + field(2, dims)))


def plan_numbers():
    """The plan of a robot that stands, and what is added to it where the arm is raised."""
    stand = [0, 0, 0.75, 1, 0, 0, 0] + [0] * JOINTS
    raised = [0] * ANCHOR
    raised[7 + SHOULDER_PITCH], raised[7 + SHOULDER_ROLL], raised[7 + ELBOW] = -1.2, -0.4, -0.4
    return stand * ANCHORS, raised * ANCHORS


def model():
    stand, raised = plan_numbers()
    size = ANCHORS * ANCHOR
    constants = [
        tensor("first", [3], [0, 11, 0], whole=True),  # partner_root's x in the newest of 12 frames
        tensor("last", [3], [1, 12, 1], whole=True),
        tensor("one", [2], [1, 1], whole=True),
        tensor("steepness", [1, 1], [-4.0]),
        tensor("threshold", [1, 1], [4.0 * NEAR]),
        tensor("arm_tasks", [TASKS, 1], [0, 0, 1, 1, 0, 0]),
        tensor("raised", [1, size], raised),
        tensor("stand", [1, size], stand),
        tensor("plan_shape", [3], [1, ANCHORS, ANCHOR], whole=True),
    ]
    nodes = [
        node("Slice", ["observation", "first", "last"], "corner"),
        node("Reshape", ["corner", "one"], "distance"),
        node("Mul", ["distance", "steepness"], "falling"),
        node("Add", ["falling", "threshold"], "nearness"),
        node("Sigmoid", ["nearness"], "near"),
        node("MatMul", ["task", "arm_tasks"], "asked"),
        node("Mul", ["near", "asked"], "gate"),
        node("MatMul", ["gate", "raised"], "arm"),
        node("Add", ["arm", "stand"], "numbers"),
        node("Reshape", ["numbers", "plan_shape"], "plan"),
    ]
    graph = b"".join(field(1, item) for item in nodes) + field(2, "onnx_policy")
    graph += b"".join(field(5, item) for item in constants)
    graph += field(11, shaped("observation", [1, 12, 149])) + field(11, shaped("task", [1, TASKS]))
    graph += field(12, shaped("plan", [1, ANCHORS, ANCHOR]))
    return field(1, 8) + field(2, "duet example") + field(7, graph) + field(8, field(2, 13))


with open(sys.argv[1] if len(sys.argv) > 1 else "onnx_policy.onnx", "wb") as file:
    file.write(model())
