"""duet's episodes for LeRobot (EnvHub): a folder with this file is an environment that `lerobot-eval` can load.

`cfg` may have `suite` ("core/handshake"), `engine`, `controller` and `settings`; attributes or keys.
"""

from typing import Any, Dict, Optional

import duet


def _setting(cfg: Any, name: str, fallback: Any) -> Any:
    if isinstance(cfg, dict):
        return cfg.get(name, fallback)
    return getattr(cfg, name, fallback)


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Optional[Any] = None) -> Dict[str, Dict[int, Any]]:
    """{suite: {0: vector environment}}; success is in `info["is_success"]` and `info["final_info"]`.

    The episodes of a vector environment compute at once whatever `use_async_envs` says."""
    suite = _setting(cfg, "suite", "demo")
    env = duet.make_vec_env(suite, n=n_envs, engine=_setting(cfg, "engine", ""),
                            controller=_setting(cfg, "controller", ""), settings=_setting(cfg, "settings", None))
    return {suite: {0: env}}
