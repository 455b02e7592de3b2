import importlib.util
import os
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

    def test_an_environment_keeps_the_rules(self):
        self.check(self.env())

    def test_an_episode_ends_with_its_row(self):
        env = self.env()
        with self.assertRaisesRegex(RuntimeError, r"call reset\(\)"):
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
