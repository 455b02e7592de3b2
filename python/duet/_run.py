"""Runs that are there: their episodes, tables, comparisons and recordings."""

from __future__ import annotations

import json
import os
from typing import Any, Dict, Iterator, List, Optional, Tuple, Union

from duet import _duet
from duet._motion import Recording, load
from duet._tools import path_of


class Table:
    """An analysis as text (`print`, a notebook), its figures in long form (`rows`; docs/file-formats.md, "Analyses"), and all
    that its JSON has (`values`)."""

    def __init__(self, table: "_duet.Table"):
        self.markdown: str = table.markdown
        self.values: Dict[str, Any] = json.loads(table.json)
        self.rows: List[Dict[str, Any]] = self.values["figures"]

    def __str__(self) -> str:
        return self.markdown

    def _repr_markdown_(self) -> str:
        return self.markdown

    def __iter__(self) -> Iterator[Any]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def dataframe(self) -> Any:
        """The figures for pandas, where that is installed."""
        import pandas  # type: ignore[import]

        return pandas.DataFrame(self.rows)


class Comparison(Table):
    """Two runs or policies on the same episodes: exact paired tests and intervals; the figure `margin` is that of the
    verdicts."""


class Run:
    """A run directory, as it was when it was read."""

    def __init__(self, path: Union[str, "os.PathLike[str]"]):
        self._folder = _duet.RunFolder(path_of(path))
        self.path: str = self._folder.path
        self.info: Dict[str, Any] = json.loads(self._folder.info)
        self.warnings: List[str] = self._folder.warnings
        self.summary: Optional[Dict[str, Any]] = None  # of the call of evaluate() that returned it
        self._episodes: Optional[List[Dict[str, Any]]] = None

    def __reduce__(self) -> Tuple[Any, Tuple[Any, ...]]:
        return _read_again, (os.path.abspath(self.path), self.summary)

    def __repr__(self) -> str:
        return f"<duet.Run {self.path!r}: {len(self.episodes)} episodes of {self.info['suite']}>"

    @property
    def episodes(self) -> List[Dict[str, Any]]:
        """The rows, in the order of the file (docs/file-formats.md, "Episode row")."""
        if self._episodes is None:
            self._episodes = json.loads(self._folder.rows)
        return self._episodes

    def columns(self, *names: str) -> Dict[str, List[Any]]:
        """The rows as columns; names of metrics are columns too."""
        chosen = names or ("key", "task", "clip", "episode", "engine", "controller", "policy", "arm", "outcome", "success")
        def value(row: Dict[str, Any], column: str) -> Any:
            return row[column] if column in row else row["metrics"].get(column)
        return {column: [value(row, column) for row in self.episodes] for column in chosen}

    def dataframe(self, *names: str) -> Any:
        """The same for pandas, where that is installed: `dataframe("task", "jpe")`; without names no metric."""
        import pandas  # type: ignore[import]

        return pandas.DataFrame(self.columns(*names))

    def table(self, name: str = "leaderboard") -> Table:
        """board, leaderboard, engines, controllers, policies, degradation, reactivity, contacts, people, levels or walking; metrics: the
        leaderboard with the means of metrics. Without a figure where the run has not what the table asks for."""
        return Table(self._folder.table(name))

    def compare(self, a: Union[str, "Run"], b: Optional[str] = None) -> Comparison:
        """Two policies of this run, `compare("dstar", "dp")`, or this run with another, `compare(other)`."""
        if isinstance(a, Run):
            return Comparison(self._folder.compare("", a._folder, ""))
        if b is None:
            raise ValueError("compare: expected two policies, or another run")
        return Comparison(self._folder.compare(a, self._folder, b))

    def recording(self, key: str) -> Recording:
        """What a run kept of an episode (`record: {trajectories: all}` in its suite); the beginning of a key is enough."""
        matching = [row for row in self.episodes if row["key"].startswith(key)]
        if len(matching) != 1:
            raise KeyError(f"{self.path}: expected one episode whose key begins with '{key}', found {len(matching)}")
        path = os.path.join(self.path, "trajectories", matching[0]["key"][:16] + ".npz")
        if not os.path.exists(path):
            raise _duet.MissingError(f"{path}: not there; a suite keeps recordings with 'record: {{trajectories: all}}'")
        recording = load(path)
        if not isinstance(recording, Recording):
            raise _duet.InputError(f"{path}: expected a recording, found a {recording.kind}")
        return recording


def _read_again(path: str, summary: Optional[Dict[str, Any]]) -> Run:
    """What another process unpickles: the folder is read there."""
    run = Run(path)
    run.summary = summary
    return run


def load_run(path: Union[str, "os.PathLike[str]"]) -> Run:
    """Reads a run directory, of `duet run` or of evaluate()."""
    return Run(path)
