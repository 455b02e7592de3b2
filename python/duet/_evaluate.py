"""Running suites with policies of Python."""

from __future__ import annotations

import json
import os
import sys
import threading
import warnings
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Tuple, Union

from duet import _duet
from duet._run import Run
from duet._tools import Names, array_of, names_of, overrides_of, path_of

Policy = Callable[[_duet.Observations], Any]
AskedPolicy = Union[None, str, Policy, Iterable[Union[str, Policy]], Mapping[str, Union[str, Policy]]]

_GLANCE = 0.05  # [s] between two looks at signals
_ended: List[threading.Thread] = []  # whose function had not come back when its evaluation ended


def evaluate(policy: AskedPolicy, suite: Union[str, "os.PathLike[str]"] = "demo", *,
             output: Union[str, "os.PathLike[str]"], engines: Names = None, controllers: Names = None,
             tasks: Names = None, perturbations: Names = None, jobs: Optional[int] = None,
             settings: Optional[Mapping[str, Any]] = None, clips: Names = None, name: Optional[str] = None,
             version: Optional[str] = None, patience: float = 60.0, retry_errors: bool = False,
             allow_programs: bool = False, progress: bool = False) -> Run:
    """Runs a suite into the folder `output` and returns what is in it; a run that is there is resumed.

    `policy` is a function, the name of a policy ("dstar"), the path of a descriptor (.yaml), a list of these, a
    mapping from names to these, or None for the suite's own. A function gets `Observations` of all episodes that wait,
    B of them, and returns plans of shape (B, 5, 36) or (B, 100, 36). It is called from one thread of its own.

    `suite` is the name of one that ships or a path; `settings` override its keys ({"clips.synth.per_task": 1}).
    `jobs` is how many episodes are under way at once; more than cores make larger batches. `version` says what the
    function is where its source does not (weights that it closes over); rows of another version have other keys.
    `patience` [s] is how long it may take for one batch. A function that raises, answers in another shape or does not
    come back ends the episodes that wait for it with a row whose outcome is `error` and whose message is the last line
    of the traceback; an answer that is not finite costs that plan.

    Ctrl-C stops the run; the same call goes on where it stopped.
    """
    suite_text = path_of(suite)
    overrides = overrides_of(settings)
    asked = _asked_policies(policy, name)
    called: List[_Called] = []
    listed: List[Tuple[str, str, Dict[str, str]]] = []
    for policy_name, what in asked:
        if callable(what):
            source = _identity(what, version)
            called.append(_Called(_duet.PlanQueue(policy_name, source, patience, 0.5), what))
            listed.append((policy_name, "python", {"source": source}))
        else:
            listed.append((policy_name, what, {}))
    only = {"engines": names_of(engines), "controllers": names_of(controllers), "tasks": names_of(tasks),
            "perturbations": names_of(perturbations)}
    folder = path_of(output)
    try:
        evaluation = _duet.Evaluation(
            suite=suite_text, overrides=overrides, clips=names_of(clips), allow_programs=allow_programs,
            policies=listed, only=only, output=folder, jobs=_duet.default_jobs() if jobs is None else jobs,
            retry_errors=retry_errors, quiet=not progress, argv=["python", "duet.evaluate", suite_text])
        for function in called:
            function.thread.start()
        summary = _finish(evaluation)
    finally:
        for function in called:
            function.end()
    run = Run(folder)
    run.summary = summary
    for sentence in summary["warnings"] + list(summary["absent"].values()) + run.info["policy_faults"]:
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
        return list(policy.items())
    several = [policy] if isinstance(policy, str) or callable(policy) else list(policy)
    if name is not None and len(several) != 1:
        raise ValueError(f"name: expected one policy, found {len(several)}; a mapping gives each its name")
    return [(name or _name_of(one), one) for one in several]


def _name_of(policy: Union[str, Policy]) -> str:
    if isinstance(policy, str):
        return os.path.splitext(os.path.basename(policy))[0] if policy.endswith(".yaml") else policy
    own = getattr(policy, "__name__", None) or type(policy).__name__
    return "python" if own == "<lambda>" else own


def _identity(policy: Policy, version: Optional[str]) -> str:
    """SHA-256 of what a function is: its version where one is given, else its source and the weights of a torch module."""
    import hashlib
    import inspect

    kind: Any = policy if hasattr(policy, "__qualname__") else type(policy)
    digest = hashlib.sha256(f"{getattr(kind, '__qualname__', '')}\n".encode())
    if version is not None:
        digest.update(f"version {version}".encode())
        return digest.hexdigest()
    try:
        digest.update(inspect.getsource(kind).encode())
    except (OSError, TypeError):
        code = getattr(policy, "__code__", None) or getattr(getattr(kind, "__call__", None), "__code__", None)
        digest.update(code.co_code if code is not None else b"")
    if callable(getattr(policy, "state_dict", None)):
        for key, tensor in sorted(policy.state_dict().items()):  # type: ignore[attr-defined]
            digest.update(key.encode())
            digest.update(tensor.detach().cpu().numpy().tobytes())
    return digest.hexdigest()


def last_line(error: BaseException) -> str:
    """The last line of its traceback."""
    import traceback

    lines = "".join(traceback.format_exception_only(type(error), error)).strip().splitlines()
    return lines[-1] if lines else type(error).__name__


class _Called:
    """A function and the thread that it is called from."""

    def __init__(self, queue: "_duet.PlanQueue", function: Policy):
        self.queue = queue
        self.function = function
        self.thread = threading.Thread(target=self._serve, name="duet-policy", daemon=True)

    def _serve(self) -> None:
        while not self.queue.closed:
            observations = self.queue.take(0.5)
            if observations is not None and not self._answered(observations):
                self._answer_each(observations)

    def _answered(self, observations: "_duet.Observations") -> bool:
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

    def end(self) -> None:
        self.queue.close("the evaluation is over")
        if self.thread.ident is None:
            return
        self.thread.join(1.0)
        if self.thread.is_alive():
            _ended.append(self.thread)
            print(f"duet: the policy has not come back from its last call; its thread is left to itself",
                  file=sys.stderr)
