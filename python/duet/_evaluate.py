"""Running suites with policies of Python."""

from __future__ import annotations

import json
import os
import sys
import threading
import warnings
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Tuple, Union

from duet import _duet
from duet._identity import forget_packages, identity_of
from duet._run import Run
from duet._tools import Names, array_of, names_of, overrides_of, path_of, whole_number

Policy = Callable[[_duet.Observations], Any]
AskedPolicy = Union[None, str, Policy, Iterable[Union[str, Policy]], Mapping[str, Union[str, Policy]]]
Version = Union[None, str, Mapping[str, str]]

_GLANCE = 0.05  # [s] between two looks at signals
_ended: List[threading.Thread] = []  # whose function had not come back when its evaluation ended


def evaluate(policy: AskedPolicy, suite: Union[str, "os.PathLike[str]"] = "demo", *,
             output: Union[str, "os.PathLike[str]"], engines: Names = None, controllers: Names = None,
             tasks: Names = None, perturbations: Names = None, jobs: Optional[int] = None,
             settings: Optional[Mapping[str, Any]] = None, clips: Names = None, name: Optional[str] = None,
             version: Version = None, patience: float = 60.0, retry_errors: bool = False, replace: bool = False,
             allow_programs: bool = False, progress: bool = False) -> Run:
    """Runs a suite into the folder `output` and returns what is in it; a run that is there is resumed.

    `policy` is a function, the name of a policy ("dstar"), the path of a descriptor (.yaml), a list of these, a
    mapping from names to these, or None for the suite's own. A function gets `Observations` of all episodes that wait,
    B of them, and returns plans of shape (B, 5, 36) or (B, 100, 36). It is called from one thread of its own.

    `suite` is the name of one that ships or a path; `settings` override its keys ({"clips.synth.per_task": 1}).
    `jobs` is how many episodes are under way at once; more than cores make larger batches.

    A function's rows are its own: its code and all data that it holds (attributes, closures, globals, arrays, weights)
    are in their keys. Where that cannot be known (an open file, a connection), or where a policy changes its own data
    while it is called, `version` stands for the data: one text, or one for each name ({"a": "7", "b": "8"}). Two
    policies of one call that are one by that are refused. A folder that has rows of the function before it was changed
    is refused, and with `replace` they make room for new ones. Rows that were there already are told by a
    RuntimeWarning. `patience` [s] is how long it may take for one batch. A function that raises, answers in another shape or does not
    come back ends the episodes that wait for it with a row whose outcome is `error` and whose message is the last line
    of the traceback; an answer that is not finite costs that plan.

    Ctrl-C stops the run; the same call goes on where it stopped.
    """
    suite_text = path_of(suite)
    overrides = overrides_of(settings)
    threads = whole_number("jobs", _duet.default_jobs() if jobs is None else jobs)
    asked = _asked_policies(policy, name)
    sources = _sources(asked, version)
    called: List[_Called] = []
    listed: List[Tuple[str, str, Dict[str, str], Optional[_duet.PlanQueue]]] = []
    for policy_name, what in asked:
        if callable(what):
            called.append(_Called(policy_name, _duet.PlanQueue(policy_name, patience, 0.5), what))
            listed.append((policy_name, "python", {"source": sources[policy_name]}, called[-1].queue))
        else:
            listed.append((policy_name, what, {}, None))
    only = {"engines": names_of(engines), "controllers": names_of(controllers), "tasks": names_of(tasks),
            "perturbations": names_of(perturbations)}
    folder = path_of(output)
    try:
        evaluation = _duet.Evaluation(
            suite=suite_text, overrides=overrides, clips=names_of(clips), allow_programs=allow_programs,
            policies=listed, only=only, output=folder, jobs=threads, retry_errors=retry_errors, replace=replace,
            quiet=not progress, argv=["python", "duet.evaluate", suite_text])
        for function in called:
            function.thread.start()
        summary = _finish(evaluation)
    finally:
        for function in called:
            function.end()
    run = Run(folder)
    run.summary = summary
    reused = [function.reused(summary["there_of"].get(function.name, 0)) for function in called]
    for sentence in reused + summary["warnings"] + list(summary["absent"].values()) + run.info["policy_faults"]:
        if sentence:
            warnings.warn(sentence, RuntimeWarning, stacklevel=2)
    return run


def _finish(evaluation: "_duet.Evaluation") -> Dict[str, Any]:
    try:
        while not evaluation.wait(_GLANCE):  # between two of them Python raises KeyboardInterrupt
            pass
    except BaseException:
        evaluation.stop()
        while not evaluation.wait(_GLANCE):
            pass
        raise
    return json.loads(evaluation.result())


def _asked_policies(policy: AskedPolicy, name: Optional[str]) -> List[Tuple[str, Union[str, Policy]]]:
    if policy is None:
        return []
    if isinstance(policy, Mapping):
        named = [(str(key), one) for key, one in policy.items()]
    else:
        if not (isinstance(policy, (str, Iterable)) or callable(policy)):
            raise ValueError(f"policy: expected a function, a name, or several of them, found {type(policy).__name__}")
        several = [policy] if isinstance(policy, str) or callable(policy) else list(policy)
        if name is not None and len(several) != 1:
            raise ValueError(f"name: expected one policy, found {len(several)}; a mapping gives each its name")
        named = [(name or _name_of(one), one) for one in several]
    if not named:
        raise ValueError("policy: expected at least one, found none; None stands for the suite's own")
    for place, (one_name, one) in enumerate(named):
        if not (isinstance(one, str) or callable(one)):
            raise ValueError(f"policy '{one_name}': expected a function or a name, found {type(one).__name__}")
        if one_name in [other for other, _ in named[:place]]:
            raise ValueError(f"policy: two are named '{one_name}'; a mapping gives each its name: {{'a': ..., 'b': ...}}")
    return named


def _sources(asked: List[Tuple[str, Union[str, Policy]]], version: Version) -> Dict[str, str]:
    """What each function is. Raises ValueError for two that are one, and where it cannot be known."""
    functions = {name: what for name, what in asked if callable(what)}
    versions = {name: version for name in functions} if version is None or isinstance(version, str) else version
    if not isinstance(versions, Mapping) or not all(isinstance(text, (str, type(None))) for text in versions.values()):
        raise ValueError(f"version: expected a text, or one for each policy by name, found {version!r}")
    strangers = [name for name in versions if name not in functions]
    if strangers:
        raise ValueError(f"version: expected names of functions ({', '.join(functions)}), found '{strangers[0]}'")
    sources: Dict[str, str] = {}
    forget_packages()
    for name, function in functions.items():
        source = identity_of(name, function, versions.get(name))
        twin = next((other for other, known in sources.items() if known == source), None)
        if twin is not None:
            raise ValueError(f"policies '{twin}' and '{name}' are one policy: the same code and the same data. Leave one "
                             f"out, or tell them apart: version={{'{twin}': '0', '{name}': '1'}}")
        sources[name] = source
    return sources


def _name_of(policy: Union[str, Policy]) -> str:
    if isinstance(policy, str):
        return os.path.splitext(os.path.basename(policy))[0] if policy.endswith(".yaml") else policy
    own = getattr(policy, "__name__", None) or type(policy).__name__
    return "python" if own == "<lambda>" else own


def last_line(error: BaseException) -> str:
    """The last line of its traceback."""
    import traceback

    lines = "".join(traceback.format_exception_only(type(error), error)).strip().splitlines()
    return lines[-1] if lines else type(error).__name__


class _Called:
    """A function and the thread that it is called from."""

    def __init__(self, name: str, queue: "_duet.PlanQueue", function: Policy):
        self.name = name
        self.queue = queue
        self.function = function
        self.calls = 0
        self.thread = threading.Thread(target=self._serve, name="duet-policy", daemon=True)

    def _serve(self) -> None:
        while not self.queue.closed:
            observations = self.queue.take(0.5)
            if observations is not None and not self._answered(observations):
                self._answer_each(observations)

    def _answered(self, observations: "_duet.Observations") -> bool:
        self.calls += 1
        try:
            self.queue.answer(observations, array_of(self.function(observations)))
            return True
        except BaseException as error:  # whatever it raises, SystemExit too, is that episode's end and not the run's
            if len(observations) == 1:
                self.queue.refuse(observations, last_line(error))
                return True
            return False

    def _answer_each(self, observations: "_duet.Observations") -> None:
        """A batch that fails is asked again one by one: which episodes fail then depends on them alone."""
        for i in range(len(observations)):
            self._answered(observations.part(i))

    def reused(self, rows: int) -> str:
        """A sentence where `rows` of it were in the folder before; else nothing."""
        if rows == 0:
            return ""
        how = "the function was not called" if self.calls == 0 else "the function was called for the others alone"
        return f"policy '{self.name}': {rows} {'row was' if rows == 1 else 'rows were'} there; {how}"

    def end(self) -> None:
        self.queue.close("the evaluation is over")
        if self.thread.ident is None:
            return
        self.thread.join(1.0)
        if self.thread.is_alive():
            _ended.append(self.thread)
            print("duet: the policy has not come back from its last call; its thread is left to itself",
                  file=sys.stderr)
