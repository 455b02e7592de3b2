"""From an estimator of people to a robot's guard: one person, in SMPL's order, with a latency.

    bridge = Bridge(focal_length=907.0, assumed_focal_length=25000.0)
    camera = GuardSocket("duet-person.socket")
    for picture, exposed_at in pictures:                       # exposed_at: by time.monotonic()
        people = [Seen(smpl_joints(p.global_orient, p.body_pose, REST, p.camera), p.id) for p in estimate(picture)]
        camera.send(bridge.message(people, exposed_at))

The message is that of docs/hardware.md, "Perception". Nothing here knows an estimator: `people` are arrays. A recording of the
messages (`PersonLog`) is what `duet hw see` and `duet hw calibrate` take.
"""

from __future__ import annotations

import math
import os
import socket
import struct
import time
from dataclasses import dataclass
from typing import Any, BinaryIO, Callable, List, Optional, Sequence, Tuple, Union

import numpy

Array = numpy.ndarray[Any, Any]

JOINTS = 24
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
MESSAGE = struct.Struct(f"<4sIQd{3 * JOINTS}dd")  # 608 bytes


def _array(name: str, value: Any, *shapes: Tuple[int, ...]) -> Array:
    array = numpy.asarray(value, dtype=float)
    if array.shape not in shapes:
        raise ValueError(f"{name}: expected shape {' or '.join(map(str, shapes))}, found {array.shape}")
    return array


def smpl_joints(global_orient: Any, body_pose: Any, rest: Any, translation: Any) -> Array:
    """The 24 joints of a body in the camera's frame [m], from what 4D-Humans and its like give: rotation matrices (3, 3) and
    (23, 3, 3), the model's joints at rest for the person's shape (24, 3) and the translation (3,). Their own lists of joints
    are in another order (OpenPose's first)."""
    turns = numpy.concatenate([_array("global_orient", global_orient, (3, 3), (1, 3, 3)).reshape(1, 3, 3),
                               _array("body_pose", body_pose, (JOINTS - 1, 3, 3))])
    at_rest = _array("rest", rest, (JOINTS, 3))
    rotations: List[Array] = [turns[0]]
    joints = numpy.empty((JOINTS, 3))
    joints[0] = at_rest[0] + _array("translation", translation, (3,))
    for joint in range(1, JOINTS):
        parent = PARENTS[joint]
        joints[joint] = joints[parent] + rotations[parent] @ (at_rest[joint] - at_rest[parent])
        rotations.append(rotations[parent] @ turns[joint])
    return joints


class OneEuroFilter:
    """A low-pass whose cut-off rises with the speed: still joints are calm, fast ones are not late (Casiez et al., CHI 2012).
    `smallest_cutoff` and `speed_cutoff` in Hz, `beta` in Hz per m/s."""

    def __init__(self, smallest_cutoff: float = 1.5, beta: float = 3.0, speed_cutoff: float = 1.0):
        self._smallest, self._beta, self._speed_cutoff = smallest_cutoff, beta, speed_cutoff
        self._at: Optional[float] = None

    def reset(self) -> None:
        self._at = None

    def update(self, values: Array, at: float) -> Array:
        """The filtered values at the time `at` [s], which rises."""
        if self._at is None or at <= self._at:
            self._values, self._speeds = numpy.array(values, dtype=float), numpy.zeros_like(values, dtype=float)
        else:
            passed = at - self._at
            speeds = (values - self._values) / passed
            self._speeds = self._speeds + _share(self._speed_cutoff, passed) * (speeds - self._speeds)
            cutoff = self._smallest + self._beta * numpy.abs(self._speeds)
            self._values = self._values + _share(cutoff, passed) * (values - self._values)
        self._at = at
        return self._values.copy()


def _share(cutoff: Any, passed: float) -> Any:
    """Of the new value, in a first-order low-pass."""
    return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * cutoff * passed))


@dataclass
class Seen:
    """A person of one picture: joints (24, 3) in SMPL's order, in the camera's frame (x right, y down, z ahead) [m], and the
    number that the estimator's tracker gave them, where it has one."""

    joints: Any
    track: Optional[int] = None


class OnePerson:
    """Follows one person: the nearest one, and then that one as long as they are seen. A tracker that gives them another
    number loses nobody: who is within `reach` of where they were, and as fast as one walks, is the same. Who was not seen
    for `patience` seconds is given up for whoever is nearest then."""

    def __init__(self, patience: float = 1.0, reach: float = 0.4, speed: float = 1.5):
        self._patience, self._reach, self._speed = patience, reach, speed
        self._track: Optional[int] = None
        self._place: Optional[Array] = None
        self._at = -math.inf
        self.switches = 0  # how often another person was taken

    def choose(self, people: Sequence[Array], tracks: Sequence[Optional[int]], at: float) -> Optional[int]:
        """The index of the person among those of a picture at the time `at`; None where they are not there."""
        chosen = None
        if self._place is not None:
            chosen = self._again(people, tracks, at)
            if chosen is None and at - self._at <= self._patience:
                return None
        if chosen is None and people:
            chosen = int(numpy.argmin([numpy.linalg.norm(joints[0]) for joints in people]))
            self.switches += self._place is not None
        if chosen is not None:
            self._track, self._place, self._at = tracks[chosen], people[chosen][0], at
        return chosen

    def _again(self, people: Sequence[Array], tracks: Sequence[Optional[int]], at: float) -> Optional[int]:
        far = [float(numpy.linalg.norm(joints[0] - self._place)) for joints in people]
        near = self._reach + self._speed * min(at - self._at, self._patience)
        same = [k for k, track in enumerate(tracks) if track is not None and track == self._track and far[k] <= near]
        known = same or [k for k in range(len(people)) if far[k] <= near]
        return min(known, key=far.__getitem__) if known else None


class Bridge:
    """Makes a message of each picture's people. `focal_length` is the camera's and `assumed_focal_length` the estimator's, both in
    pixels of one picture: an estimator that takes another puts people too near or too far by their ratio. `latency` is
    added to what is measured from `exposed_at` (of the camera itself) [s]."""

    def __init__(self, focal_length: Optional[float] = None, assumed_focal_length: Optional[float] = None,
                 latency: float = 0.0, smooth: Optional[OneEuroFilter] = None, person: Optional[OnePerson] = None,
                 clock: Callable[[], float] = time.monotonic):
        if (focal_length is None) != (assumed_focal_length is None):
            raise ValueError("focal_length and assumed_focal_length: expected both or none of them, found one")
        for name, value in (("focal_length", focal_length), ("assumed_focal_length", assumed_focal_length)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: expected a number of pixels above 0, found {value}")
        self._depth = focal_length / assumed_focal_length if focal_length and assumed_focal_length else 1.0
        self._latency, self._clock = latency, clock
        self._filter = smooth if smooth is not None else OneEuroFilter()
        self.person = person if person is not None else OnePerson()
        self._sequence = int(1e6 * clock())  # above those of a bridge before
        self._switches = 0

    def message(self, people: Sequence[Seen], exposed_at: float) -> bytes:
        """The message of a picture that was taken at `exposed_at`, by the bridge's clock."""
        joints = [self._at_depth(_array("joints", seen.joints, (JOINTS, 3))) for seen in people]
        chosen = self.person.choose(joints, [seen.track for seen in people], exposed_at)
        if chosen is not None and self.person.switches != self._switches:
            self._switches = self.person.switches
            self._filter.reset()
        smooth = numpy.zeros((JOINTS, 3)) if chosen is None else self._filter.update(joints[chosen], exposed_at)
        self._sequence += 1
        now = self._clock()
        return MESSAGE.pack(b"DPJ2", int(chosen is not None), self._sequence, now, *smooth.ravel(),
                            max(now - exposed_at, 0.0) + self._latency)

    def _at_depth(self, joints: Array) -> Array:
        """The pelvis' depth by the camera's focal length; the body keeps its size."""
        moved = joints.copy()
        moved[:, 2] += (self._depth - 1.0) * joints[0, 2]
        return moved


class GuardSocket:
    """The socket at which a guard waits for a person (`--person-socket`)."""

    def __init__(self, path: Union[str, "os.PathLike[str]"] = "duet-person.socket"):
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._path = os.fspath(path)

    def send(self, message: bytes) -> bool:
        """Whether a guard took it."""
        try:
            return self._socket.sendto(message, self._path) == len(message)
        except OSError:
            return False

    def close(self) -> None:
        self._socket.close()


class PersonLog:
    """A file of messages, as `duet hw see` and `duet hw calibrate` take it."""

    def __init__(self, path: Union[str, "os.PathLike[str]"]):
        self._file: BinaryIO = open(path, "wb")

    def send(self, message: bytes) -> bool:
        return self._file.write(message) == len(message)

    def close(self) -> None:
        self._file.close()
