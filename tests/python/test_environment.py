import copy
import gc
import importlib.util
import inspect
import os
import pickle
import signal
import threading
import time
import unittest

import numpy

import duet
from support import SOURCE, ScratchTest, main_arm


class Batches(ScratchTest):
    def batch(self, n, **options):
        batch = duet.Batch(self.suite(per_task=2), n=n, **options)
        self.addCleanup(batch.close)
        return batch

    def test_episodes_that_are_led_are_those_of_evaluate(self):
        suite = self.suite(per_task=2, engines="mujoco", controllers="vmc")
        run = duet.evaluate(lambda observations: observations.hold(), suite, output=self.path("run"), name="mine")
        expected = {row["clip"]: row for row in main_arm(run)}
        batch = duet.Batch(suite, n=4)
        self.addCleanup(batch.close)
        batch.reset()
        while not batch.view("over").all():
            batch.step(batch.view("hold"))
        for place in range(4):
            row = batch.row(place)
            self.assertEqual(row["state_hash"], expected[row["clip"]]["state_hash"])
            self.assertEqual(row["seed"], expected[row["clip"]]["seed"])

    def test_views_are_live_read_only_and_without_copies(self):
        batch = self.batch(3)
        views = {name: batch.view(name) for name in batch.VIEWS}
        shapes = {"frames": (3, 12, 149), "partner": (3, 24, 3), "q": (3, 29), "v": (3, 29), "root": (3, 7), "over": (3,),
                  "hold": (3, 5, 36), "orientation": (3, 4), "velocity": (3, 3), "tick": (3,)}
        for name, shape in shapes.items():
            self.assertEqual(views[name].shape, shape, name)
        self.assertTrue(views["over"].all())
        batch.reset()
        self.assertFalse(views["over"].any())
        self.assertTrue((views["root"][:, 2] > 0.5).all())
        before = views["partner"].copy()
        for _ in range(5):
            batch.step(batch.view("hold"))
        self.assertEqual(views["tick"].tolist(), [50, 50, 50])
        self.assertGreater(numpy.abs(views["partner"] - before).max(), 1e-4)
        frames = views["frames"]
        self.assertTrue((views["q"] == frames[:, -1, 84:113]).all())
        self.assertTrue((views["v"] == frames[:, -1, 113:142]).all())
        self.assertTrue((views["partner"].reshape(3, 72) == frames[:, -1, 3:75]).all())
        self.assertTrue((views["orientation"] == frames[:, -1, 145:149]).all())
        for name, view in views.items():
            self.assertTrue(numpy.shares_memory(view, batch.view(name)), name)
            self.assertFalse(view.flags.writeable, name)
        self.assertTrue(numpy.shares_memory(views["q"], frames))
        del batch
        self.assertEqual(frames.shape, (3, 12, 149))  # a view keeps what it shows

    def test_episodes_compute_without_the_interpreter(self):
        batch = duet.Batch(self.suite(per_task=1, engines="mujoco", controllers="vmc"), n=4)
        self.addCleanup(batch.close)
        batch.reset()
        counted, over = [0], threading.Event()
        def count():
            while not over.is_set():
                counted[0] += 1
                time.sleep(0)
        thread = threading.Thread(target=count)
        thread.start()
        begin = counted[0]
        batch.step(batch.view("hold"))
        self.assertGreater(counted[0], begin)
        over.set()
        thread.join()

    def test_bad_plans_and_places_are_refused(self):
        batch = self.batch(2)
        with self.assertRaisesRegex(ValueError, "the episode is over|expected plans"):
            batch.step(numpy.zeros((2, 5)))
        batch.reset()
        with self.assertRaisesRegex(ValueError, r"step: expected plans of shape \(2, 5, 36\) or \(2, 100, 36\), found \(1, 5, 36\)"):
            batch.step(batch.view("hold")[:1])
        with self.assertRaisesRegex(ValueError, "expected one of frames, .*, found 'torque'"):
            batch.view("torque")
        with self.assertRaisesRegex(ValueError, "episode: expected a number from 0 to 3, found 4"):
            batch.reset([4, 0])
        with self.assertRaisesRegex(ValueError, "place below 2, found 2"):
            batch.reset([0], [2])
        with self.assertRaisesRegex(ValueError, "n: expected 1 to 4096 episodes, found 0"):
            duet.Batch(self.suite(), n=0)
        for options, pattern in (({"engine": "dart"}, "dart"), ({"controller": "vmc"}, "vmc"), ({"perturbation": "ice"}, "ice")):
            with self.assertRaisesRegex(ValueError, pattern):
                duet.Batch(self.suite(), n=1, **options)

    def test_a_plan_that_is_not_finite_is_left_out_and_the_row_says_so(self):
        batch = self.batch(1)
        batch.reset()
        while not batch.view("over").all():
            batch.step(numpy.full((1, 5, 36), numpy.nan))
        self.assertGreater(batch.row(0)["policy_faults"]["invalid"], 5)


def begun_alone(env, seed):
    return env.reset(seed=seed)[1]["episode"]


class Seeds(ScratchTest):
    """Gymnasium's contract: what a place begins depends on its seed alone."""

    def setUp(self):
        super().setUp()
        self.tiny = self.suite(per_task=5)
        self.alone = duet.make_env(self.tiny)
        self.addCleanup(self.alone.close)

    def vector(self, n):
        env = duet.make_vec_env(self.tiny, n=n)
        self.addCleanup(env.close)
        return env

    def test_place_i_of_seed_i_begins_what_one_environment_of_that_seed_begins(self):
        seeds = [3, 0, 1009, 2**63 + 1, 7, 7, 12]
        alone = [begun_alone(self.alone, seed) for seed in seeds]
        for n in (1, 2, 7):
            env = self.vector(n)
            found = []
            for first in range(0, len(seeds), n):
                part = (seeds[first:first + n] + [0] * n)[:n]
                found += env.reset(seed=part)[1]["episode"].tolist()
            self.assertEqual(found[:len(seeds)], alone)
        backwards = self.vector(7).reset(seed=seeds[::-1])[1]["episode"].tolist()
        self.assertEqual(backwards, alone[::-1])
        self.assertEqual(self.vector(4).reset(seed=numpy.int64(100))[1]["episode"].tolist(),
                         [begun_alone(self.alone, 100 + i) for i in range(4)])

    def test_observations_of_a_seed_are_those_of_one_environment_to_the_bit(self):
        env = self.vector(3)
        observations, _ = env.reset(seed=[4, 9, 4])
        for place, seed in enumerate((4, 9, 4)):
            self.assertTrue((observations[place] == self.alone.reset(seed=seed)[0]).all())
        for _ in range(3):
            observations = env.step(env.hold())[0]
        self.alone.reset(seed=9)
        for _ in range(3):
            one = self.alone.step(self.alone.hold())[0]
        self.assertTrue((observations[1] == one).all())

    def test_what_follows_a_seed_depends_on_it_alone(self):
        self.alone.reset(seed=5)
        alone = [self.alone.reset()[1]["episode"] for _ in range(6)]
        for n in (2, 3):
            env, found = self.vector(n), []
            _, info = env.reset(seed=[0] * (n - 1) + [5])
            while len(found) < 6:
                _, _, _, _, info = env.step(env.hold())
                if info.get("_episode", numpy.zeros(n, bool))[n - 1]:
                    found.append(int(info["episode"][n - 1]))
            self.assertEqual(found, alone)

    def test_seeds_in_a_row_begin_every_episode_once(self):
        self.assertEqual(self.alone.episodes, 10)
        self.assertEqual(sorted(begun_alone(self.alone, seed) for seed in range(1000, 1010)), list(range(10)))

    def test_in_turn_every_episode_begins_once(self):
        for n in (1, 3, 4):
            env, begun = self.vector(n), []
            _, info = env.reset(options={"in_turn": True})
            begun += [int(e) for e, again in zip(info["episode"], info["repeated"]) if not again]
            while len(begun) < 10:
                _, _, _, _, info = env.step(env.hold())
                if "_episode" in info:
                    begun += [int(info["episode"][i]) for i in numpy.flatnonzero(info["_episode"] & ~info["repeated"])]
            self.assertEqual(sorted(begun), list(range(10)))
        in_turn = [self.alone.reset(options={"in_turn": True})[1]] + [self.alone.reset()[1] for _ in range(10)]
        self.assertEqual([info["episode"] for info in in_turn], [*range(10), 0])
        self.assertEqual([info["repeated"] for info in in_turn], [False] * 10 + [True])

    def test_every_beginning_says_what_it_is(self):
        env = self.vector(3)
        _, info = env.reset(seed=[2, 8, 5])
        self.assertEqual([info["_task"].all(), info["_episode"].all()], [True, True])
        beginnings = 0
        for _ in range(150):
            for place in range(3):
                alone = self.alone.reset(options={"episode": int(info["episode"][place])})[1]
                for key in ("episode", "task", "prompt", "clip"):
                    self.assertEqual(info[key][place], alone[key])
                self.assertEqual(env.call("task_description")[place], alone["prompt"])
                self.assertEqual((env.envs[place].task, env.envs[place].clip), (alone["task"], alone["clip"]))
            self.assertTrue(set(info["task"]) <= {"wave", "handshake"})
            while True:
                _, _, _, _, info = env.step(env.hold())
                if "_episode" in info:
                    break
            beginnings += int(info["_episode"].sum())
            if beginnings > 5:
                break
        self.assertGreater(beginnings, 5)

    def test_wrong_seeds_and_options_are_refused(self):
        env = self.vector(2)
        for options, pattern in (({"seed": [1]}, "seed: expected 2 of them, found 1"), ({"seed": 1.5}, "seed: expected a whole number, found 1.5"),
                                 ({"seed": -1}, "seed: expected a number from 0, found -1"),
                                 ({"options": {"episodes": [1]}}, "episodes: expected 2, found 1"),
                                 ({"options": {"episodes": [1, 10]}}, "episode: expected a number .*10")):
            with self.subTest(pattern), self.assertRaisesRegex(ValueError, pattern):
                env.reset(**options)
        env.reset(seed=[1, None], options={"a_loop's_own": True})  # what others pass along is no fault

    def test_a_mask_begins_anew_where_it_says(self):
        env = self.vector(3)
        _, before = env.reset(seed=[1, 2, 3])
        _, after = env.reset(options={"reset_mask": numpy.array([False, True, False]), "episodes": [0, 9, 0]})
        self.assertEqual(after["episode"].tolist(), [before["episode"][0], 9, before["episode"][2]])
        self.assertEqual(after["_episode"].tolist(), [False, True, False])


class Processes(ScratchTest):
    def in_child(self, work):
        """What a forked child printed about `work`; it is ended where it hangs."""
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(read)
            signal.alarm(60)
            try:
                said = work()
            except BaseException as error:
                said = f"{type(error).__name__}: {error}"
            os.write(write, str(said).encode())
            os._exit(0)
        os.close(write)
        with os.fdopen(read) as pipe:
            said = pipe.read()
        self.assertEqual(os.waitpid(child, 0)[1], 0, "the child hung")
        return said

    def test_a_forked_child_that_steps_its_parents_environment_gets_a_sentence(self):
        suite = self.suite()
        env, vector = duet.make_env(suite), duet.make_vec_env(suite, n=2)
        self.addCleanup(env.close)
        self.addCleanup(vector.close)
        env.reset(seed=0)
        vector.reset(seed=0)
        sentence = "RuntimeError: the episode runs in process .*forked from it: expected episodes that this process has made"
        for one in (env, vector):
            self.assertRegex(self.in_child(lambda: one.step(one.hold())), sentence)
            self.assertRegex(self.in_child(lambda: one.reset(seed=1)), sentence)
            self.assertEqual(self.in_child(one.close), "None")
        env.step(env.hold())  # and the parent's goes on
        vector.step(vector.hold())

    def test_a_forked_child_that_lets_its_parents_environment_go_does_not_wait(self):
        held = [duet.make_env(self.suite())]
        self.addCleanup(held.clear)
        held[0].reset(seed=0)
        self.assertEqual(self.in_child(lambda: (held.clear(), gc.collect(), "gone")[-1]), "gone")

    def test_a_forked_child_makes_its_own(self):
        suite = self.suite()
        duet.make_env(suite).reset(seed=3)
        self.assertEqual(self.in_child(lambda: duet.make_env(suite).reset(seed=3)[1]["episode"]), "1")

    def test_environments_are_not_pickled(self):
        suite = self.suite()
        for env in (duet.make_env(suite), duet.make_vec_env(suite, n=2), duet.make_parallel_env(suite), duet.Batch(suite, n=1)):
            self.addCleanup(env.close)
            with self.assertRaisesRegex(TypeError, "call duet.make_env.. in the process that steps it"):
                pickle.dumps(env)


class GymnasiumForm(ScratchTest):
    def hub(self):
        spec = importlib.util.spec_from_file_location("hub_env", os.path.join(SOURCE, "examples", "python", "envhub", "env.py"))
        hub = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(hub)
        return hub

    def env(self):
        env = duet.make_env(self.suite(per_task=2))
        self.addCleanup(env.close)
        return env

    def check(self, env):
        """The rules of gymnasium.utils.env_checker.check_env that do not need its classes."""
        observation, info = env.reset(seed=123)
        again, info_again = env.reset(seed=123)
        self.assertTrue((observation == again).all())
        self.assertEqual(info, info_again)
        self.assertIsInstance(info, dict)
        self.assertIn(observation, env.observation_space)
        self.assertEqual(observation.dtype, env.observation_space.dtype)
        action = env.action_space.sample()
        self.assertIn(action, env.action_space)
        result = env.step(action)
        self.assertEqual(len(result), 5)
        observation, reward, terminated, truncated, info = result
        self.assertIn(observation, env.observation_space)
        self.assertIsInstance(reward, float)
        self.assertIsInstance(terminated, bool)
        self.assertIsInstance(truncated, bool)
        self.assertIsInstance(info, dict)
        observation, _ = env.reset(seed=123)  # an action drawn at random lets the robot fall
        before = observation.copy()
        env.step(env.hold())
        self.assertTrue((observation == before).all())  # what was returned does not change
        self.assertIsNone(env.render())
        self.assertIs(env.unwrapped, env)
        # check_reset_seed: the generator is that of the seed.
        states = []
        for seed in (123, 123, 456):
            env.reset(seed=seed)
            states.append(copy.deepcopy(env.unwrapped._np_random.bit_generator.state))
        self.assertEqual(states[0], states[1])
        self.assertNotEqual(states[1], states[2])
        self.assertEqual(env.np_random_seed, 456)
        for name, default in (("seed", None), ("options", None)):
            self.assertIs(inspect.signature(env.reset).parameters[name].default, default)
        observation, info = env.reset(options={})
        self.assertIn(observation, env.observation_space)
        self.assertFalse(callable(getattr(env, "seed", None)))
        # check_step_determinism
        action = env.action_space.sample()
        results = []
        for _ in range(2):
            env.reset(seed=123)
            results.append(env.step(action))
        self.assertTrue((results[0][0] == results[1][0]).all())
        self.assertEqual(results[0][1:4], results[1][1:4])
        env.close()
        env.close()

    def test_gymnasiums_own_checker_has_nothing_against_it(self):
        try:
            from gymnasium.utils.env_checker import check_env
        except ImportError:
            self.skipTest("not run: gymnasium absent; test_an_environment_keeps_the_rules says the same")
        check_env(self.env(), skip_render_check=True)

    def test_an_environment_keeps_the_rules(self):
        self.check(self.env())

    def test_an_episode_ends_with_its_row(self):
        env = self.env()
        with self.assertRaisesRegex(RuntimeError, r"no episode has begun: call reset\(\)"):
            env.step(numpy.zeros((5, 36)))
        observation, info = env.reset(options={"episode": 1})
        self.assertEqual(info["episode"], 1)
        self.assertIn(env.hold(), env.action_space)
        steps, terminated, truncated = 0, False, False
        while not (terminated or truncated):
            observation, reward, terminated, truncated, info = env.step(env.hold())
            steps += 1
        self.assertGreater(steps, 5)
        self.assertEqual(info["row"]["clip"], env._batch.clip(1))
        self.assertEqual(reward, float(info["is_success"]))
        self.assertEqual(info["outcome"], "ok")
        self.assertLessEqual(steps, env._max_episode_steps)
        with self.assertRaisesRegex(RuntimeError, r"the episode is over: call reset\(\)"):
            env.step(env.hold())
        env.close()
        for call in (lambda: env.step(env.action_space.sample()), env.reset):
            with self.assertRaisesRegex(RuntimeError, "the environment is closed"):
                call()

    def test_plans_have_the_shape_of_one_environment_in_the_message(self):
        env = self.env()
        env.reset(seed=1)
        for plan, pattern in ((numpy.zeros(36), r"expected plans of shape \(5, 36\) or \(100, 36\), found \(36,\)"),
                              (numpy.zeros((1, 5, 36)), r"found \(1, 5, 36\)")):
            with self.assertRaisesRegex(ValueError, pattern):
                env.step(plan)
        for wrong in (env.hold() > 0, env.hold().astype(complex), env.hold().astype(str)):
            with self.assertRaisesRegex(TypeError, "expected an array of numbers, found one of"):
                env.step(wrong)
        env.step(env.hold().ravel())
        env.step(env.hold().astype(numpy.float16).tolist())

    def test_names_of_evaluate_are_taken_too(self):
        env = duet.make_env(self.suite(engines="mujoco, playback"), engines=["playback"], controllers="pd")
        self.addCleanup(env.close)
        with self.assertRaisesRegex(ValueError, "engine: an environment has one, found mujoco, playback"):
            duet.make_env(self.suite(), engines=["mujoco", "playback"])

    def test_a_task_of_a_suite_that_ships_is_chosen_by_its_name(self):
        env = duet.make_env("core/bend", engine="playback", settings={"clips.synth.per_task": 1})
        self.addCleanup(env.close)
        _, info = env.reset(seed=1)
        self.assertIn("bend", info["clip"])

    def test_vector_environments_begin_anew_by_themselves(self):
        env = duet.make_vec_env(self.suite(per_task=1), n=3)
        self.addCleanup(env.close)
        observations, _ = env.reset(seed=5)
        self.assertIn(observations, env.observation_space)
        self.assertEqual(observations.shape, (3, 12, 149))
        ended = numpy.zeros(3, int)
        for _ in range(300):  # an episode is up to 100 steps
            observations, rewards, terminated, truncated, info = env.step(env.hold())
            self.assertEqual((rewards.shape, terminated.shape, truncated.shape), ((3,), (3,), (3,)))
            ended += terminated
            if terminated.any():
                self.assertEqual(info["_final_info"].tolist(), terminated.tolist())
                rows = [row for row in info["final_info"]["row"] if row is not None]
                self.assertEqual(len(rows), terminated.sum())
            if (ended >= 2).all():
                break
        self.assertTrue((ended >= 2).all())

    def test_the_hub_file_offers_success_as_lerobot_reads_it(self):
        made = self.hub().make_env(n_envs=2, cfg={"suite": self.suite()})
        (env,) = next(iter(made.values())).values()
        self.addCleanup(env.close)
        env.reset(seed=[3, 4])
        for _ in range(120):
            _, _, terminated, truncated, info = env.step(env.hold())
            if (terminated | truncated).any():
                break
        self.assertEqual(info["final_info"]["is_success"].dtype, bool)
        self.assertEqual(info["_final_info"].tolist(), (terminated | truncated).tolist())

    def test_a_loop_as_lerobot_has_it_evaluates_every_episode_once(self):
        """lerobot_eval.rollout and eval_policy: seeds in a row, flat actions, the task of each place, success at the end."""
        env = next(iter(self.hub().make_env(n_envs=4, cfg={"suite": self.suite(per_task=3)}).values()))[0]
        self.addCleanup(env.close)
        max_steps = env.call("_max_episode_steps")[0]
        successes, clips, tasks = [], [], []
        for batch in range(2):  # 6 episodes, 4 at a time
            observation, info = env.reset(seed=range(batch * 4, batch * 4 + 4), options={"new_rollout": True})
            clips += list(info["clip"])
            done, ended_well = numpy.zeros(4, bool), numpy.zeros(4, bool)
            for step in range(max_steps):
                tasks += list(env.call("task_description"))
                self.assertTrue(hasattr(env.envs[0], "task_description") and hasattr(env.envs[0], "task"))
                observation, reward, terminated, truncated, info = env.step(env.hold().reshape(4, -1).astype(numpy.float32))
                if "final_info" in info:
                    ended_well |= numpy.array(info["final_info"]["is_success"].tolist()) & ~done
                done |= terminated | truncated
                if done.all():
                    break
            self.assertTrue(done.all())
            successes += ended_well.tolist()
        self.assertEqual(len(set(clips[:6])), 6)
        self.assertEqual(len(successes), 8)
        self.assertEqual(env.unwrapped.metadata["render_fps"], 5)
        self.assertTrue(all(tasks))

    def test_the_hub_file_makes_a_vector_environment(self):
        suite = self.suite()
        made = self.hub().make_env(n_envs=2, cfg={"suite": suite})
        env = made[suite][0]
        self.addCleanup(env.close)
        env.reset(seed=0)
        _, _, _, _, info = env.step(env.hold())
        self.assertEqual(info["is_success"].shape, (2,))


if __name__ == "__main__":
    unittest.main()
