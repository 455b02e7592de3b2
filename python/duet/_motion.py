"""Clips, paired motions and recordings as read-only arrays; retargeting, scores and detectors."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Type, Union

from duet import _duet
from duet._tools import array_of, path_of, texts_of, whole_number

if TYPE_CHECKING:
    import numpy

    Array = numpy.ndarray[Any, Any]

Path = Union[str, "os.PathLike[str]"]


class Motion:
    """A file of motion. `motion["q"]` is a read-only view of the array of that key, and keeps the motion alive."""

    _prefix = ""  # of the robot's keys

    def __init__(self, archive: "_duet.Archive"):
        self._archive = archive

    @property
    def kind(self) -> str:
        return self._archive.kind

    def keys(self) -> List[str]:
        return self._archive.keys()

    def __contains__(self, key: str) -> bool:
        return key in self._archive

    def __getitem__(self, key: str) -> Any:
        return self._archive[key]

    def __repr__(self) -> str:
        return f"<duet.{type(self).__name__} {self._archive.name!r}>"

    def save(self, path: Path) -> None:
        """As NPZ (docs/file-formats.md); the write is atomic."""
        self._archive.save(path_of(path))

    @property
    def rate_hz(self) -> float:
        return self._archive["rate_hz"]


def _text(key: str, about: str) -> property:
    def get(self: Motion) -> Any:
        return self._archive[self._prefix + key]

    return property(get, doc=about)


class _Numbers:
    """An attribute that is a view of the array of a key, in types too."""

    def __init__(self, key: str, about: str):
        self._key = key
        self.__doc__ = about

    def __get__(self, motion: Any, kind: Any = None) -> "Array":
        return self if motion is None else motion._archive[motion._prefix + self._key]

    def __set__(self, motion: Any, value: Any) -> None:
        raise AttributeError(f"{self._key}: a motion is read-only")


class _Acted(Motion):
    """Of a task."""

    task = property(lambda self: self._archive["task"], doc="Its task.")
    phases = property(lambda self: self._archive["phases"], doc="(2,): frames at which the act begins and ends.")


class _Moved(Motion):
    """A robot's base and joints over time."""

    root_position = _Numbers("root_position", "(T, 3): the robot's base [m].")
    root_quat_wxyz = _Numbers("root_quat_wxyz", "(T, 4): its orientation.")
    q = _Numbers("q", "(T, 29): joints [rad].")


class _Named(_Moved):
    joint_names = _text("joint_names", "Names of q's columns.")


class Clip(_Acted):
    """Two people and a task."""

    id = _text("id", "Its name.")
    reactor = _text("reactor", "Who the robot replaces: A or B.")
    a = _Numbers("a_joints", "(T, 24, 3): person A, SMPL-24 joints [m].")
    b = _Numbers("b_joints", "(T, 24, 3): person B.")


class Paired(_Acted, _Named):
    """What retargeting makes of a clip: the robot's motion beside the adapted partner."""

    _prefix = "robot_"
    id = property(lambda self: self._archive["clip_id"], doc="Its clip's name.")

    @property
    def partner(self) -> "Array":
        """(T, 24, 3): the partner after adaptation [m]."""
        return self._archive["partner_joints"]


class Recording(_Acted, _Moved):
    """What a robot did beside a partner: states at 50 Hz."""

    outcome = _text("outcome", "How it ended.")
    message = _text("message", "Why, where it did not end well.")
    root_velocity = _Numbers("root_velocity", "(T, 3) [m/s].")
    v = _Numbers("v", "(T, 29) [rad/s].")
    q_target = _Numbers("q_target", "(T, 29): what the joints were sent [rad].")
    reference_q = _Numbers("reference_q", "(T, 29): what the controller was asked for [rad].")
    partner = _Numbers("partner", "(T, 24, 3): the human partner [m].")

    @property
    def row(self) -> Optional[Dict[str, Any]]:
        """The episode's row, of a recording that a run kept."""
        return json.loads(self["row"]) if "row" in self else None


class RobotMotion(_Named):
    """A robot's motion from a file of any of `robot_motion_formats()`."""

    evidence = _text("evidence", "Sentences: what was found of order, units and rate.")


_KINDS: Dict[str, Type[Motion]] = {"clip": Clip, "paired": Paired, "recording": Recording, "robot": RobotMotion}


def load(path: Path, *, as_is: bool = False) -> Any:
    """A clip, a paired motion or a recording (NPZ). Raises InputError for anything else, naming what was found, and for a
    clip of people who cannot be (size, up axis, floor, sides) but with `as_is`."""
    archive = _duet.load(path_of(path), as_is)
    return _KINDS[archive.kind](archive)


def clip(a: Any, b: Any, *, rate_hz: float, task: str, reactor: str = "B", act: Optional[Tuple[int, int]] = None,
         id: str = "clip", as_is: bool = False) -> Clip:
    """Two people from joints of shape (T, 24, 3) [m], world frame, z up. The act's frames are proposed where none are
    given. People who cannot be (in millimetres, with another axis up, below the floor, left and right exchanged) are
    refused as on the command line, but with `as_is`."""
    return Clip(_duet.make_clip(array_of(a), array_of(b), rate_hz, task, reactor, act, id, as_is))


def synthesize(task: str, *, seed: int = 42, index: int = 0) -> Clip:
    """A clip made from nothing, the same for the same arguments."""
    numbers = {"seed": whole_number("seed", seed), "index": whole_number("index", index)}
    for name, (number, most) in {"seed": (numbers["seed"], 2**64), "index": (numbers["index"], 2**31)}.items():
        if not 0 <= number < most:
            raise ValueError(f"{name}: expected a number from 0 to {most - 1}, found {number}")
    return Clip(_duet.synthesize(task, numbers["seed"], numbers["index"]))


def retarget(a: Any, b: Any = None, *, rate_hz: float = 50.0, task: str = "", reactor: str = "", robot: str = "",
             options: Optional[Mapping[str, Any]] = None, act: Optional[Tuple[int, int]] = None,
             as_is: bool = False) -> Paired:
    """PAIR: one person becomes the robot. `retarget(clip)`, or joints of two people with rate and task, which are those of
    people who can be, but with `as_is` (clip()).

    `options` are those of `duet list pair-options` ({"mode": "best"})."""
    if not isinstance(a, Clip):
        if b is None or not task:
            raise ValueError("retarget: expected a clip, or joints of two people and a task")
        a = clip(a, b, rate_hz=rate_hz, task=task, reactor=reactor or "B", act=act, as_is=as_is)
    if reactor not in ("", "A", "B"):
        raise ValueError(f"reactor: expected A or B, found '{reactor}'")
    return Paired(_duet.retarget(a._archive, texts_of(options), robot, reactor))


def _motion_of(motion: Union[Motion, Path], as_is: bool = False) -> Motion:
    return motion if isinstance(motion, Motion) else load(motion, as_is=as_is)


def score(motion: Union[Motion, Path], *, readings: Optional[Mapping[str, Any]] = None, thresholds: str = "paper",
          robot: str = "", as_is: bool = False) -> Dict[str, Any]:
    """What `duet score --json` says of one file: the 18 metrics and the detectors, of a run's recording its row again."""
    return json.loads(_duet.score(_motion_of(motion, as_is)._archive, texts_of(readings), thresholds, robot))


def detect(motion: Union[Motion, Path], task: str, *, version: str = "robot", thresholds: str = "paper",
           robot: str = "") -> Dict[str, Any]:
    """A task's detector over human and robot: success, parts, values, margins, and the evidence per frame."""
    return json.loads(_duet.detect(_motion_of(motion)._archive, task, version, thresholds, robot))


class _People(Sequence[Clip]):
    def __init__(self, *asked: Any):
        self._asked = asked
        self._reader = _duet.PeopleReader(*asked)
        self.format: str = self._reader.format

    def __reduce__(self) -> Tuple[Any, Tuple[Any, ...]]:
        return _People, self._asked

    def __len__(self) -> int:
        return len(self._reader)

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        if not -len(self) <= i < len(self):
            raise IndexError(f"people: expected a place below {len(self)}, found {i}")
        archive, evidence = self._reader.at(i % len(self))
        read = Clip(archive)
        read.evidence = evidence  # type: ignore[attr-defined]
        return read

    def __iter__(self) -> Iterator[Clip]:
        return (self[i] for i in range(len(self)))


def read_people(paths: Union[Path, Sequence[Path]], *, format: str = "", task: str = "", rate: Optional[float] = None,
                up: str = "", unit: Optional[float] = None, reactor: str = "") -> Sequence[Clip]:
    """Recordings of two people in any of `people_formats()`; each is read when it is asked for.

    What a file does not say, or says wrongly, is said here, as `duet import` has it: `rate` [Hz], `up`, the axis that
    points up ("y", "-z"), `unit`, metres per unit of the file (0.001 for millimetres), and `reactor`, A or B."""
    several = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    return _People([path_of(path) for path in several], format, task, reactor, rate, up, unit)


def people_formats() -> List[str]:
    return _duet.people_formats()


def read_robot_motion(path: Path, *, format: str = "", robot: str = "") -> RobotMotion:
    return RobotMotion(_duet.read_robot_motion(path_of(path), format, robot))


def write_robot_motion(motion: Union[Paired, RobotMotion], path: Path, *, format: str, robot: str = "") -> None:
    """A robot's motion in one of `robot_motion_formats()`; some of them are only read."""
    _duet.write_robot_motion(motion._archive, path_of(path), format, robot)


def robot_motion_formats() -> List[str]:
    return _duet.robot_motion_formats()


def dataset(folder: Path) -> List[Dict[str, Any]]:
    """The entries of a data set that `duet dataset` made (docs/datasets.md)."""
    return json.loads(_duet.dataset_entries(path_of(folder)))
