"""Episodes that Python leads step by step: a batch with live views, and environments in Gymnasium's and PettingZoo's form.

A step is a plan: it lasts 0.2 s of the episode, and the loop that runs it is that of `duet run`.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Mapping, NoReturn, Optional, Sequence, Tuple

from duet import _duet
from duet._spaces import batched, box
from duet._tools import Names, array_of, names_of, overrides_of, whole_number

if TYPE_CHECKING:
    import numpy

    Array = numpy.ndarray[Any, Any]

_FARTHEST = 20.0  # [m] of the root from the origin, in action spaces
_UNPICKLED = ("expected a function that makes an environment, found an environment: its episodes run on threads of this "
              "process; call duet.make_env() in the process that steps it")


def _one_of(kind: str, one: str, several: Names) -> str:
    """Of `engine="dart"` and `engines=["dart"]`, as evaluate() has it."""
    names = [name for name in [one] if name] + names_of(several)
    if len(names) > 1:
        raise ValueError(f"{kind}: an environment has one, found {', '.join(names)}")
    return names[0] if names else ""


def _suite_of(suite: str, engine: str, controller: str, perturbation: str, settings: Optional[Mapping[str, Any]],
              jobs: Optional[int]) -> "_duet.EpisodeEnvironment":
    """"core/handshake": the suite's clips of one task; "core": all of them."""
    task = ""
    if not suite.endswith(".yaml") and suite.count("/") == 1:
        suite, task = suite.split("/")
    return _duet.EpisodeEnvironment(suite, overrides_of(settings), engine, controller, task, perturbation,
                          _duet.default_jobs() if jobs is None else whole_number("jobs", jobs))


class Batch:
    """n episodes in step, each on a thread of its own, all without the interpreter's lock.

    `view(name)` is a live array: it shows what every episode sees after each reset() and step(), without a copy.
    """

    VIEWS = ("frames", "partner", "velocity", "angular_velocity", "gravity", "q", "v", "offset", "orientation", "root",
             "hold", "over", "success", "tick", "episode")

    def __init__(self, suite: str = "demo", *, n: int, engine: str = "", controller: str = "", perturbation: str = "",
                 settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None, leads_partner: bool = False):
        """`leads_partner`: the partners are led as well, and there is a view `partner_ahead` more."""
        self._suite = _suite_of(suite, engine, controller, perturbation, settings, jobs)
        self._batch = _duet.EpisodeBatch(self._suite, whole_number("n", n), leads_partner)

    def __len__(self) -> int:
        return len(self._batch)

    @property
    def episodes(self) -> int:
        """How many episodes there are to choose from."""
        return len(self._suite)

    @property
    def joints(self) -> List[str]:
        return self._suite.joints

    def view(self, name: str) -> "Array":
        """(n, ...), read-only: frames (n, 12, 149), q and v (n, 29), partner (n, 24, 3), root (n, 7), hold (n, 5, 36): the
        null arm's plans, over, success, tick, episode (n,). Where partners are led, partner_ahead (n, 10, 24, 3): where
        each is to be at the ticks up to the next step [m, frame W], as in the clip until step() says otherwise."""
        return self._batch.view(name)

    def reset(self, episodes: Optional[Iterable[int]] = None, places: Optional[Iterable[int]] = None) -> None:
        """Begins an episode at each place, by default the first n of the suite in turn at all places."""
        at = list(range(len(self))) if places is None else [int(place) for place in places]
        numbers = [place % self.episodes for place in at] if episodes is None else [int(number) for number in episodes]
        self._batch.reset(at, numbers)

    def step(self, plans: Any, partners: Any = None) -> None:
        """Plans of shape (n, 5, 36) or (n, 100, 36); those of episodes that are over are not looked at. `partners`, where
        they are led: (n, 10, 24, 3), in the place of partner_ahead."""
        self._batch.step(array_of(plans), None if partners is None else array_of(partners))

    def row(self, place: int) -> Optional[Dict[str, Any]]:
        """The row of an episode that is over."""
        text = self._batch.row(place)
        return json.loads(text) if text else None

    def clip(self, episode: int) -> str:
        """Which clip an episode is of."""
        return self._suite.about(episode)[0]

    def about(self, episode: int) -> Dict[str, Any]:
        """What an episode is: its number, clip, task and prompt."""
        clip, task, prompt = self._suite.about(episode)
        return {"episode": episode, "clip": clip, "task": task, "prompt": prompt}

    @property
    def most_steps(self) -> int:
        """How many steps an episode has at most."""
        return self._suite.most_steps

    def close(self) -> None:
        self._batch.close()

    def __reduce__(self) -> NoReturn:
        raise TypeError(_UNPICKLED)

    def _action_space(self) -> Any:
        import numpy

        low = numpy.concatenate([[-_FARTHEST, -_FARTHEST, 0.0], numpy.full(4, -1.0), self._suite.lower])
        high = numpy.concatenate([numpy.full(3, _FARTHEST), numpy.full(4, 1.0), self._suite.upper])
        return box(low, high, (5, len(low)))

    def _observation_space(self) -> Any:
        import numpy

        return box(-numpy.inf, numpy.inf, self.view("frames").shape[1:])


class _Turns:
    """Which episodes one place begins. A seed begins episode seed modulo their number, and then draws from a generator of
    its own: nothing depends on how many places there are."""

    def __init__(self, episodes: int, place: int = 0, places: int = 1):
        self._episodes, self._place, self._places = episodes, place, places
        self._first: Optional[int] = None
        self._begun: Optional[int] = None  # in turn: how many
        self.last_seed = -1
        self.random: Any = None

    def seed(self, seed: int) -> None:
        import numpy

        if seed < 0:
            raise ValueError(f"seed: expected a number from 0, found {seed}")
        self.random = numpy.random.default_rng(seed)
        self._first, self._begun, self.last_seed = seed % self._episodes, None, seed

    def in_turn(self) -> None:
        self._begun = 0

    def generator(self) -> Any:
        import numpy

        if self.random is None:
            self.random = numpy.random.default_rng()
        return self.random

    def next(self, chosen: Optional[int] = None) -> Tuple[int, bool]:
        """The episode, and whether it was begun before since all began in turn."""
        first, self._first = self._first, None
        if chosen is not None:
            self._begun = None
            return chosen, False
        if self._begun is not None:
            number = self._place + self._begun * self._places
            self._begun += 1
            return number % self._episodes, number >= self._episodes
        return (int(self.generator().integers(self._episodes)) if first is None else first), False


def _begin(batch: Batch, turns: _Turns, seed: Any, options: Optional[Mapping[str, Any]]) -> Dict[str, Any]:
    """Begins one episode and says which."""
    asked = options or {}
    if seed is not None:
        turns.seed(whole_number("seed", seed))
    if asked.get("in_turn"):
        turns.in_turn()
    chosen = asked.get("episode")
    episode, repeated = turns.next(None if chosen is None else whole_number("episode", chosen))
    batch.reset([episode], [0])
    return {**batch.about(episode), "repeated": repeated}


def _ended_info(row: Optional[Dict[str, Any]]) -> Dict[str, Any]:
    return {"is_success": bool(row and row["success"]), "outcome": row["outcome"] if row else "error", "row": row}


def _plans(action: Any, width: int, places: Tuple[int, ...]) -> Any:
    """Numbers of shape (*places, 5 or 100, width), flat ones too."""
    plans = array_of(action)
    flat = plans.shape[len(places):]
    if plans.shape[:len(places)] == places and flat in ((5 * width,), (100 * width,)):
        plans = plans.reshape(*places, -1, width)
    if plans.shape[:-2] != places or plans.shape[-2:] not in ((5, width), (100, width)):
        said = [str((*places, rows, width)) for rows in (5, 100)]
        raise ValueError(f"step: expected plans of shape {said[0]} or {said[1]}, found {plans.shape}")
    return plans


class _Open:
    """What the environments share: a batch that is there until it is closed."""

    def __init__(self, batch: Batch):
        self._batch = batch
        self._is_closed = False
        self._was_reset = False

    @property
    def episodes(self) -> int:
        """How many episodes there are: seeds 0 to that less one begin each of them once."""
        return self._batch.episodes

    @property
    def _max_episode_steps(self) -> int:
        return self._batch.most_steps

    def _require_open(self, stepped: bool) -> None:
        if self._is_closed:
            raise RuntimeError("the environment is closed: make another one")
        if stepped and not self._was_reset:
            raise RuntimeError("no episode has begun: call reset()")

    def render(self) -> None:
        return None

    def close(self) -> None:
        self._batch.close()
        self._is_closed = True

    def __reduce__(self) -> NoReturn:
        raise TypeError(_UNPICKLED)


class Env(_Open):
    """One episode in Gymnasium's form. The reward is 1 at the end of an episode that the suite's detector accepts."""

    metadata: Dict[str, Any] = {"render_modes": [], "render_fps": 5}
    render_mode = None
    reward_range = (0.0, 1.0)
    spec = None

    def __init__(self, batch: Batch):
        super().__init__(batch)
        self.observation_space = batch._observation_space()
        self.action_space = batch._action_space()
        self._turns = _Turns(batch.episodes)
        self._about: Dict[str, Any] = {}
        self._np_random: Any = None  # where Gymnasium's checker looks for it

    @property
    def unwrapped(self) -> "Env":
        return self

    @property
    def np_random(self) -> Any:
        return self._turns.generator()

    @property
    def np_random_seed(self) -> Optional[int]:
        """The last seed; -1 where none was given, as Gymnasium has it."""
        return self._turns.last_seed

    @property
    def task(self) -> str:
        """Of the episode."""
        return str(self._about.get("task", ""))

    @property
    def task_description(self) -> str:
        """The episode's language command."""
        return str(self._about.get("prompt", ""))

    def reset(self, *, seed: Optional[int] = None, options: Optional[Mapping[str, Any]] = None) -> Tuple["Array", Dict[str, Any]]:
        """Begins an episode: with a seed, episode `seed` modulo their number; with `options={"episode": 3}` that one; from
        `options={"in_turn": True}` on, each once, one a reset; else one that is drawn. `info` says which it is (episode,
        clip, task, prompt), and whether it is repeated since all began in turn."""
        self._require_open(False)
        self._about = _begin(self._batch, self._turns, seed, options)
        self._np_random = self._turns.random
        self._was_reset = True
        return self._observation(), dict(self._about)

    def step(self, action: Any) -> Tuple["Array", float, bool, bool, Dict[str, Any]]:
        self._require_open(True)
        if self._batch.view("over")[0]:
            raise RuntimeError("the episode is over: call reset()")
        self._batch.step(_plans(action, self.action_space.shape[-1], ())[None])
        if not self._batch.view("over")[0]:
            return self._observation(), 0.0, False, False, {"is_success": False}
        info = _ended_info(self._batch.row(0))
        truncated = info["outcome"] == "timeout"
        return self._observation(), float(info["is_success"]), not truncated, truncated, info

    def hold(self) -> "Array":
        """The action that stands still: the null arm's."""
        return self._batch.view("hold")[0].copy()

    def _observation(self) -> "Array":
        return self._batch.view("frames")[0].copy()


class _Place:
    """One place of a vector environment, as `envs` shows it: what its episode is."""

    def __init__(self, of: "VectorEnv", place: int):
        self._of, self._at = of, place

    @property
    def task(self) -> str:
        return str(self._of._about["task"][self._at])

    @property
    def task_description(self) -> str:
        return str(self._of._about["prompt"][self._at])

    @property
    def episode(self) -> int:
        return int(self._of._about["episode"][self._at])

    @property
    def clip(self) -> str:
        return str(self._of._about["clip"][self._at])

    @property
    def _max_episode_steps(self) -> int:
        return self._of._max_episode_steps


class VectorEnv(_Open):
    """n episodes in the form of Gymnasium's vector environments; one that is over begins anew at the next step."""

    metadata: Dict[str, Any] = {"render_modes": [], "render_fps": 5, "autoreset_mode": "NextStep"}
    render_mode = None
    spec = None
    closed = False

    def __init__(self, batch: Batch):
        import numpy

        super().__init__(batch)
        self.num_envs = len(batch)
        self.single_observation_space = batch._observation_space()
        self.single_action_space = batch._action_space()
        self.observation_space = batched(self.single_observation_space, self.num_envs)
        self.action_space = batched(self.single_action_space, self.num_envs)
        self.envs = [_Place(self, place) for place in range(self.num_envs)]
        self._turns = [_Turns(batch.episodes, place, self.num_envs) for place in range(self.num_envs)]
        self._about: Dict[str, Any] = {
            "episode": numpy.full(self.num_envs, -1), "clip": numpy.full(self.num_envs, "", object),
            "task": numpy.full(self.num_envs, "", object), "prompt": numpy.full(self.num_envs, "", object),
            "repeated": numpy.zeros(self.num_envs, bool)}

    @property
    def unwrapped(self) -> "VectorEnv":
        return self

    def call(self, name: str, *arguments: Any, **options: Any) -> Tuple[Any, ...]:
        """An attribute of each place ("task", "task_description"), called where it is a function."""
        values = tuple(getattr(place, name) for place in self.envs)
        return tuple(value(*arguments, **options) if callable(value) else value for value in values)

    def get_attr(self, name: str) -> Tuple[Any, ...]:
        return self.call(name)

    def reset(self, *, seed: Any = None, options: Optional[Mapping[str, Any]] = None) -> Tuple["Array", Dict[str, Any]]:
        """Begins an episode at each place. `seed`: one a place, or a number that stands for seed, seed + 1, ...; a place of
        a seed begins what Env begins of that seed. `options`: {"episodes": [...]}, one a place; {"in_turn": True}: from now
        on each episode once, place i has episodes i, i + n, ...; {"reset_mask": ...}: at these places alone."""
        import numpy

        self._require_open(False)
        asked = options or {}
        mask = asked.get("reset_mask")
        places = range(self.num_envs) if mask is None else [int(place) for place in numpy.flatnonzero(mask)]
        for turns, one in zip(self._turns, self._seeds(seed)):
            if one is not None:
                turns.seed(one)
            if asked.get("in_turn"):
                turns.in_turn()
        chosen = asked.get("episodes")
        if chosen is not None and len(chosen) != self.num_envs:
            raise ValueError(f"episodes: expected {self.num_envs}, found {len(chosen)}")
        info = self._begin(places, None if chosen is None else [whole_number("episodes", one) for one in chosen])
        self._was_reset = True
        return self._observations(), info

    def step(self, actions: Any) -> Tuple["Array", "Array", "Array", "Array", Dict[str, Any]]:
        """`info` has `is_success` of each place; where episodes end, `final_info` and `_final_info`; where episodes begin,
        what reset() says, with `_episode`, `_task`, ... for the places that have begun."""
        import numpy

        self._require_open(True)
        over_before = self._batch.view("over").astype(bool)
        self._batch.step(_plans(actions, self.single_action_space.shape[-1], (self.num_envs,)))
        begun = self._begin(numpy.flatnonzero(over_before)) if over_before.any() else {}
        ended = self._batch.view("over").astype(bool) & ~over_before
        infos: List[Dict[str, Any]] = [_ended_info(self._batch.row(i)) if ended[i] else {} for i in range(self.num_envs)]
        truncated = numpy.array([info.get("outcome") == "timeout" for info in infos])
        success = numpy.array([info.get("is_success", False) for info in infos])
        info: Dict[str, Any] = {"is_success": success, **begun}
        if ended.any():
            info.update({"final_info": {"is_success": success, "row": [one.get("row") for one in infos]},
                         "_final_info": ended})
        return self._observations(), success.astype(numpy.float64), ended & ~truncated, truncated, info

    def hold(self) -> "Array":
        return self._batch.view("hold").copy()

    def close(self, **options: Any) -> None:
        super().close()
        self.closed = True

    def _seeds(self, seed: Any) -> List[Optional[int]]:
        if seed is None:
            return [None] * self.num_envs
        several = list(seed) if hasattr(seed, "__len__") else [whole_number("seed", seed) + i for i in range(self.num_envs)]
        if len(several) != self.num_envs:
            raise ValueError(f"seed: expected {self.num_envs} of them, found {len(several)}")
        return [None if one is None else whole_number("seed", one) for one in several]

    def _begin(self, places: Iterable[int], chosen: Optional[Sequence[int]] = None) -> Dict[str, Any]:
        """Begins an episode at these places. What all places are at, and which have begun, as Gymnasium's infos have it."""
        import numpy

        at = [int(place) for place in places]
        begun = [self._turns[place].next(None if chosen is None else chosen[place]) for place in at]
        self._batch.reset([episode for episode, _ in begun], at)
        mask = numpy.zeros(self.num_envs, bool)
        mask[at] = True
        for place, (episode, repeated) in zip(at, begun):
            for key, value in {**self._batch.about(episode), "repeated": repeated}.items():
                self._about[key][place] = value
        info = {key: values.copy() for key, values in self._about.items()}
        return {**info, **{f"_{key}": mask.copy() for key in self._about}}

    def _observations(self) -> "Array":
        return self._batch.view("frames").copy()


class ParallelEnv(_Open):
    """One episode in PettingZoo's parallel form: the agents "robot" and "partner" act at once and share the reward.

    Both observe the frames that a policy sees. The robot's action is a plan (5, 36); the partner's says where the 24
    joints are at the next ten ticks, (10, 24, 3) [m, frame W]. `infos["partner"]["ahead"]` is that of the clip.
    """

    metadata: Dict[str, Any] = {"name": "duet", "render_modes": [], "is_parallelizable": True, "render_fps": 5}
    render_mode = None

    def __init__(self, batch: Batch):
        super().__init__(batch)
        frames = batch._observation_space()
        self.possible_agents = ["robot", "partner"]
        self.agents: List[str] = []
        self.observation_spaces = {"robot": frames, "partner": frames}
        self.action_spaces = {"robot": batch._action_space(), "partner": box(-_FARTHEST, _FARTHEST, (10, 24, 3))}
        self._turns = _Turns(batch.episodes)

    @property
    def unwrapped(self) -> "ParallelEnv":
        return self

    @property
    def num_agents(self) -> int:
        return len(self.agents)

    @property
    def max_num_agents(self) -> int:
        return len(self.possible_agents)

    def observation_space(self, agent: str) -> Any:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        return self.action_spaces[agent]

    def reset(self, seed: Optional[int] = None, options: Optional[Mapping[str, Any]] = None) -> Tuple[Dict[str, Any], Dict[str, Any]]:
        """As of the Gymnasium form."""
        self._require_open(False)
        said = _begin(self._batch, self._turns, seed, options)
        self._was_reset = True
        self.agents = list(self.possible_agents)
        return self._observations(), {"robot": said, "partner": {**said, "ahead": self._ahead()}}

    def step(self, actions: Mapping[str, Any]) -> Tuple[Dict[str, Any], Dict[str, float], Dict[str, bool], Dict[str, bool], Dict[str, Any]]:
        self._require_open(True)
        if not self.agents:
            raise RuntimeError("the episode is over: call reset()")
        missing = [agent for agent in self.agents if agent not in actions]
        if missing or len(actions) > len(self.agents):
            raise ValueError(f"step: expected an action of each of {self.agents}, found {list(actions)}")
        plans = _plans(actions["robot"], self.action_spaces["robot"].shape[-1], ())
        self._batch.step(plans[None], array_of(actions["partner"])[None])
        agents, over = self.agents, bool(self._batch.view("over")[0])
        info = _ended_info(self._batch.row(0)) if over else {"is_success": False}
        truncated = info.get("outcome") == "timeout"
        infos = {"robot": info, "partner": info if over else {**info, "ahead": self._ahead()}}
        if over:
            self.agents = []
        return (self._observations(), {agent: float(info["is_success"]) for agent in agents},
                {agent: over and not truncated for agent in agents}, {agent: truncated for agent in agents}, infos)

    def hold(self, agent: str) -> Any:
        """The action that stands still."""
        if agent == "robot":
            return self._batch.view("hold")[0].copy()
        return self._batch.view("partner")[0][None].repeat(10, axis=0)

    def state(self) -> Any:
        """What is there whoever looks at it: the frames."""
        return self._batch.view("frames")[0].copy()

    def _observations(self) -> Dict[str, Any]:
        return {agent: self._batch.view("frames")[0].copy() for agent in self.possible_agents}

    def _ahead(self) -> Any:
        return self._batch.view("partner_ahead")[0].copy()


def make_env(suite: str = "demo", *, engine: str = "", controller: str = "", perturbation: str = "",
             settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None, engines: Names = None,
             controllers: Names = None) -> Env:
    """An environment in Gymnasium's form: `make_env("core/handshake", engine="dart")`; `engines` and `controllers` are the
    same with evaluate()'s names, of one each. Where Gymnasium is installed it is one of its environments too."""
    return _of_package(Env, "gymnasium", "Env")(Batch(
        suite, n=1, engine=_one_of("engine", engine, engines), controller=_one_of("controller", controller, controllers),
        perturbation=perturbation, settings=settings, jobs=jobs))


def make_vec_env(suite: str = "demo", *, n: int, engine: str = "", controller: str = "", perturbation: str = "",
                 settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None, engines: Names = None,
                 controllers: Names = None) -> VectorEnv:
    """n of them, which compute at once."""
    return _of_package(VectorEnv, "gymnasium", "vector.VectorEnv")(Batch(
        suite, n=n, engine=_one_of("engine", engine, engines), controller=_one_of("controller", controller, controllers),
        perturbation=perturbation, settings=settings, jobs=jobs))


def make_parallel_env(suite: str = "demo", *, engine: str = "", controller: str = "", perturbation: str = "",
                      settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None, engines: Names = None,
                      controllers: Names = None) -> ParallelEnv:
    """Robot and partner as two agents, in PettingZoo's parallel form. Where PettingZoo is installed it is one of its
    environments too. Its rows are no benchmark's: the partner does what it is told."""
    return _of_package(ParallelEnv, "pettingzoo", "ParallelEnv")(Batch(
        suite, n=1, engine=_one_of("engine", engine, engines), controller=_one_of("controller", controller, controllers),
        perturbation=perturbation, settings=settings, jobs=jobs, leads_partner=True))


def _of_package(kind: Any, package: str, name: str) -> Any:
    """`kind` as a subclass of that package's class of that name, where there is one."""
    import importlib

    try:
        base: Any = importlib.import_module(package)
    except ImportError:
        return kind
    for part in name.split("."):
        base = getattr(base, part)
    return type(kind.__name__, (kind, base), {"__module__": kind.__module__})
