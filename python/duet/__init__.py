"""duet: a benchmark for two-person interactions with a humanoid. The guide is docs/using-duet.md.

    run = duet.evaluate(my_policy, "demo", engines=["mujoco"], jobs=2, output="runs/mine")
    print(run.table())

Everything here calls the library that the command line calls: the same runner, rows, keys and hashes. NumPy is loaded
when the first array is asked for, gymnasium and pettingzoo when an environment is made.
"""

from duet._duet import InputError, MissingError, Observations, StorageError, __version__
from duet._environment import Batch, Env, ParallelEnv, VectorEnv, make_env, make_parallel_env, make_vec_env
from duet._evaluate import evaluate
from duet._motion import (Clip, Paired, Recording, RobotMotion, clip, dataset, detect, load, people_formats, read_people,
                          read_robot_motion, retarget, robot_motion_formats, score, synthesize, write_robot_motion)
from duet._run import Comparison, Run, Table, load_run
from duet._tools import engines, policies, suites, tasks

__all__ = [
    "Batch", "Clip", "Comparison", "Env", "InputError", "MissingError", "Observations", "Paired", "Recording",
    "RobotMotion", "Run", "StorageError", "Table", "VectorEnv", "__version__", "clip", "dataset", "detect", "engines",
    "evaluate", "load", "load_run", "make_env", "make_parallel_env", "make_vec_env", "people_formats", "policies", "read_people",
    "read_robot_motion", "retarget", "robot_motion_formats", "score", "suites", "synthesize", "tasks",
    "write_robot_motion",
]
