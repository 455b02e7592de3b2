"""What this machine has, and how Python's values become duet's texts."""

from __future__ import annotations

import json
import operator
import os
from typing import Any, Dict, Iterable, List, Mapping, Optional, Tuple, Union

from duet import _duet

Names = Union[None, str, Iterable[str]]


def engines() -> List[Dict[str, Any]]:
    """The engines with whether they are there, and why not."""
    return json.loads(_duet.listing("engines"))


def policies() -> List[Dict[str, Any]]:
    """The policies that can be asked for by name."""
    return json.loads(_duet.listing("policies"))


def suites() -> List[str]:
    """The suites that ship with duet."""
    return [entry["name"] for entry in json.loads(_duet.listing("suites"))]


def tasks() -> List[str]:
    return [entry["name"] for entry in json.loads(_duet.listing("tasks"))]


def names_of(names: Names) -> List[str]:
    """One name, several, or none for all."""
    if names is None:
        return []
    return [names] if isinstance(names, str) else [str(name) for name in names]


def text_of(value: Any) -> str:
    """A value of a suite's key as YAML has it: JSON is YAML."""
    return value if isinstance(value, str) else json.dumps(value)


def overrides_of(settings: Optional[Mapping[str, Any]]) -> List[Tuple[str, str]]:
    return [(key, text_of(value)) for key, value in (settings or {}).items()]


def texts_of(options: Optional[Mapping[str, Any]]) -> Dict[str, str]:
    """Options as text; True and False as duet writes them."""
    return {key: text_of(value) for key, value in (options or {}).items()}


def path_of(path: Union[str, "os.PathLike[str]"]) -> str:
    return os.fspath(path)


def array_of(numbers: Any) -> Any:
    """An array of float64 in C order; a tensor of torch leaves its graph and its device. Raises ValueError or TypeError in
    NumPy's words for what is no array of numbers."""
    import numpy

    if numbers is None:
        raise TypeError("expected an array of numbers, found None")
    if hasattr(numbers, "detach"):
        numbers = numbers.detach().cpu().numpy()
    array = numpy.asarray(numbers)
    if array.dtype.kind not in "iufO":
        raise TypeError(f"expected an array of numbers, found one of {array.dtype}")
    return numpy.ascontiguousarray(array, dtype=numpy.float64)


def whole_number(name: str, value: Any) -> int:
    """An int, or what is one exactly (NumPy's). Raises ValueError for others."""
    try:
        return operator.index(value)
    except TypeError:
        raise ValueError(f"{name}: expected a whole number, found {value!r}") from None
