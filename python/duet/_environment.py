"""Episodes that Python leads step by step: a batch with live views, and environments in Gymnasium's and PettingZoo's form.

A step is a plan: it lasts 0.2 s of the episode, and the loop that runs it is that of `duet run`.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Mapping, Optional, Tuple

from duet import _duet
from duet._spaces import batched, box
from duet._tools import array_of, overrides_of

if TYPE_CHECKING:
    import numpy

    Array = numpy.ndarray[Any, Any]

_FARTHEST = 20.0  # [m] of the root from the origin, in action spaces


def _suite_of(suite: str, engine: str, controller: str, perturbation: str, settings: Optional[Mapping[str, Any]],
              jobs: Optional[int]) -> "_duet.LedSuite":
    """"core/handshake": the suite's clips of one task; "core": all of them."""
    task = ""
    if not suite.endswith(".yaml") and suite.count("/") == 1:
        suite, task = suite.split("/")
    return _duet.LedSuite(suite, overrides_of(settings), engine, controller, task, perturbation,
                          _duet.default_jobs() if jobs is None else jobs)


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
        self._batch = _duet.EpisodeBatch(self._suite, n, leads_partner)

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
        return self._suite.clip(episode)

    def close(self) -> None:
        self._batch.close()

    def _action_space(self) -> Any:
        import numpy

        low = numpy.concatenate([[-_FARTHEST, -_FARTHEST, 0.0], numpy.full(4, -1.0), self._suite.lower])
        high = numpy.concatenate([numpy.full(3, _FARTHEST), numpy.full(4, 1.0), self._suite.upper])
        return box(low, high, (5, len(low)))

    def _observation_space(self) -> Any:
        import numpy

        return box(-numpy.inf, numpy.inf, self.view("frames").shape[1:])


def _begin(batch: Batch, random: Any, options: Optional[Mapping[str, Any]]) -> Dict[str, Any]:
    """Begins one episode, `options["episode"]` or one that is drawn, and says which."""
    chosen = (options or {}).get("episode")
    episode = int(random.integers(batch.episodes)) if chosen is None else int(chosen)
    batch.reset([episode], [0])
    return {"episode": episode, "clip": batch.clip(episode)}


def _ended_info(row: Optional[Dict[str, Any]]) -> Dict[str, Any]:
    return {"is_success": bool(row and row["success"]), "outcome": row["outcome"] if row else "error", "row": row}


class Env:
    """One episode in Gymnasium's form. The reward is 1 at the end of an episode that the suite's detector accepts."""

    metadata: Dict[str, Any] = {"render_modes": [], "render_fps": 5}
    render_mode = None
    reward_range = (0.0, 1.0)
    spec = None

    def __init__(self, batch: Batch):
        self._batch = batch
        self.observation_space = batch._observation_space()
        self.action_space = batch._action_space()
        self._random: Any = None

    @property
    def unwrapped(self) -> "Env":
        return self

    @property
    def np_random(self) -> Any:
        import numpy

        if self._random is None:
            self._random = numpy.random.default_rng()
        return self._random

    def reset(self, *, seed: Optional[int] = None, options: Optional[Mapping[str, Any]] = None) -> Tuple[Any, Dict[str, Any]]:
        """`options={"episode": 3}` chooses an episode; else it is drawn, the same for the same seed."""
        import numpy

        if seed is not None:
            self._random = numpy.random.default_rng(seed)
        info = _begin(self._batch, self.np_random, options)
        return self._observation(), info

    def step(self, action: Any) -> Tuple[Any, float, bool, bool, Dict[str, Any]]:
        if self._batch.view("over")[0]:
            raise RuntimeError("the episode is over: call reset()")
        self._batch.step(array_of(action)[None])
        if not self._batch.view("over")[0]:
            return self._observation(), 0.0, False, False, {"is_success": False}
        info = _ended_info(self._batch.row(0))
        truncated = info["outcome"] == "timeout"
        return self._observation(), float(info["is_success"]), not truncated, truncated, info

    def hold(self) -> Any:
        """The action that stands still: the null arm's."""
        return self._batch.view("hold")[0].copy()

    def render(self) -> None:
        return None

    def close(self) -> None:
        self._batch.close()

    def _observation(self) -> Any:
        return self._batch.view("frames")[0].copy()


class VectorEnv:
    """n episodes in the form of Gymnasium's vector environments; one that is over begins anew at the next step."""

    metadata: Dict[str, Any] = {"render_modes": [], "autoreset_mode": "NextStep"}
    render_mode = None
    spec = None
    closed = False

    def __init__(self, batch: Batch):
        import numpy

        self._batch = batch
        self.num_envs = len(batch)
        self.single_observation_space = batch._observation_space()
        self.single_action_space = batch._action_space()
        self.observation_space = batched(self.single_observation_space, self.num_envs)
        self.action_space = batched(self.single_action_space, self.num_envs)
        self._random = numpy.random.default_rng()

    @property
    def unwrapped(self) -> "VectorEnv":
        return self

    def reset(self, *, seed: Any = None, options: Optional[Mapping[str, Any]] = None) -> Tuple[Any, Dict[str, Any]]:
        import numpy

        if seed is not None:
            self._random = numpy.random.default_rng(seed)
        episodes = (options or {}).get("episodes")
        if episodes is None:
            episodes = self._random.integers(self._batch.episodes, size=self.num_envs)
        self._batch.reset(episodes)
        return self._observations(), {"episode": self._batch.view("episode").copy()}

    def step(self, actions: Any) -> Tuple[Any, Any, Any, Any, Dict[str, Any]]:
        import numpy

        over_before = self._batch.view("over").astype(bool)
        self._batch.step(actions)
        again = numpy.flatnonzero(over_before)
        if len(again) > 0:
            self._batch.reset(self._random.integers(self._batch.episodes, size=len(again)), again)
        ended = self._batch.view("over").astype(bool) & ~over_before
        infos: List[Dict[str, Any]] = [_ended_info(self._batch.row(i)) if ended[i] else {} for i in range(self.num_envs)]
        truncated = numpy.array([info.get("outcome") == "timeout" for info in infos])
        success = numpy.array([info.get("is_success", False) for info in infos])
        info: Dict[str, Any] = {"is_success": success}
        if ended.any():
            info.update({"final_info": {"is_success": success, "row": [one.get("row") for one in infos]},
                         "_final_info": ended})
        return self._observations(), success.astype(numpy.float64), ended & ~truncated, truncated, info

    def hold(self) -> Any:
        return self._batch.view("hold").copy()

    def render(self) -> None:
        return None

    def close(self) -> None:
        self._batch.close()
        self.closed = True

    def _observations(self) -> Any:
        return self._batch.view("frames").copy()


class ParallelEnv:
    """One episode in PettingZoo's parallel form: the agents "robot" and "partner" act at once and share the reward.

    Both observe the frames that a policy sees. The robot's action is a plan (5, 36); the partner's says where the 24
    joints are at the next ten ticks, (10, 24, 3) [m, frame W]. `infos["partner"]["ahead"]` is that of the clip.
    """

    metadata: Dict[str, Any] = {"name": "duet", "render_modes": [], "is_parallelizable": True, "render_fps": 5}
    render_mode = None

    def __init__(self, batch: Batch):
        frames = batch._observation_space()
        self._batch = batch
        self.possible_agents = ["robot", "partner"]
        self.agents: List[str] = []
        self.observation_spaces = {"robot": frames, "partner": frames}
        self.action_spaces = {"robot": batch._action_space(), "partner": box(-_FARTHEST, _FARTHEST, (10, 24, 3))}
        self._random: Any = None

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
        import numpy

        if seed is not None or self._random is None:
            self._random = numpy.random.default_rng(seed)
        said = _begin(self._batch, self._random, options)
        self.agents = list(self.possible_agents)
        return self._observations(), {"robot": said, "partner": {**said, "ahead": self._ahead()}}

    def step(self, actions: Mapping[str, Any]) -> Tuple[Dict[str, Any], Dict[str, float], Dict[str, bool], Dict[str, bool], Dict[str, Any]]:
        if not self.agents:
            raise RuntimeError("the episode is over: call reset()")
        missing = [agent for agent in self.agents if agent not in actions]
        if missing or len(actions) > len(self.agents):
            raise ValueError(f"step: expected an action of each of {self.agents}, found {list(actions)}")
        self._batch.step(array_of(actions["robot"])[None], array_of(actions["partner"])[None])
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

    def render(self) -> None:
        return None

    def close(self) -> None:
        self._batch.close()

    def state(self) -> Any:
        """What is there whoever looks at it: the frames."""
        return self._batch.view("frames")[0].copy()

    def _observations(self) -> Dict[str, Any]:
        return {agent: self._batch.view("frames")[0].copy() for agent in self.possible_agents}

    def _ahead(self) -> Any:
        return self._batch.view("partner_ahead")[0].copy()


def make_env(suite: str = "demo", *, engine: str = "", controller: str = "", perturbation: str = "",
             settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None) -> Any:
    """An environment in Gymnasium's form: `make_env("core/handshake", engine="dart")`. Where Gymnasium is installed it is
    one of its environments too."""
    batch = Batch(suite, n=1, engine=engine, controller=controller, perturbation=perturbation, settings=settings, jobs=jobs)
    return _of_package(Env, "gymnasium", "Env")(batch)


def make_vec_env(suite: str = "demo", *, n: int, engine: str = "", controller: str = "", perturbation: str = "",
                 settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None) -> Any:
    """n of them, which compute at once."""
    batch = Batch(suite, n=n, engine=engine, controller=controller, perturbation=perturbation, settings=settings, jobs=jobs)
    return _of_package(VectorEnv, "gymnasium", "vector.VectorEnv")(batch)


def make_parallel_env(suite: str = "demo", *, engine: str = "", controller: str = "", perturbation: str = "",
                      settings: Optional[Mapping[str, Any]] = None, jobs: Optional[int] = None) -> Any:
    """Robot and partner as two agents, in PettingZoo's parallel form. Where PettingZoo is installed it is one of its
    environments too. Its rows are no benchmark's: the partner does what it is told."""
    batch = Batch(suite, n=1, engine=engine, controller=controller, perturbation=perturbation, settings=settings, jobs=jobs,
                  leads_partner=True)
    return _of_package(ParallelEnv, "pettingzoo", "ParallelEnv")(batch)


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
