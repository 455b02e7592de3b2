import unittest

import numpy

import duet
from support import ScratchTest


class ParallelForm(ScratchTest):
    def env(self):
        env = duet.make_parallel_env(self.suite(per_task=2))
        self.addCleanup(env.close)
        return env

    def as_in_the_clip(self, env, infos):
        return {"robot": env.hold("robot"), "partner": infos["partner"]["ahead"]}

    def test_it_keeps_the_rules(self):
        """Those of pettingzoo.test.parallel_api_test that do not need its classes."""
        env = self.env()
        self.assertEqual((env.possible_agents, env.agents), (["robot", "partner"], []))
        observations, infos = env.reset(seed=3)
        again, _ = env.reset(seed=3)
        self.assertEqual(env.agents, env.possible_agents)
        self.assertEqual(set(infos), {"robot", "partner"})
        for agent in env.agents:
            self.assertTrue((observations[agent] == again[agent]).all())
            self.assertIn(observations[agent], env.observation_space(agent))
            self.assertIs(env.action_space(agent), env.action_space(agent))
            self.assertIn(env.hold(agent), env.action_space(agent))
            self.assertIn(env.action_space(agent).sample(), env.action_space(agent))
        for _ in range(200):
            agents = list(env.agents)
            results = env.step(self.as_in_the_clip(env, infos))
            infos = results[4]
            for result in results:
                self.assertEqual(list(result), agents)
            self.assertEqual(len({results[2][agent] or results[3][agent] for agent in agents}), 1)
            if results[2]["robot"] or results[3]["robot"]:
                break
        self.assertEqual((env.agents, env.num_agents, env.max_num_agents), ([], 0, 2))
        self.assertEqual(results[1]["robot"], results[1]["partner"])
        self.assertEqual(results[1]["robot"], float(infos["robot"]["row"]["success"]))
        with self.assertRaisesRegex(RuntimeError, r"call reset\(\)"):
            env.step({})

    def test_a_partner_who_does_what_the_clip_does_leaves_the_row_of_an_episode_that_is_led_alone(self):
        env = self.env()
        _, infos = env.reset(options={"episode": 1})
        while env.agents:
            _, _, _, _, infos = env.step(self.as_in_the_clip(env, infos))
        alone = duet.make_env(self.suite(per_task=2))
        self.addCleanup(alone.close)
        alone.reset(options={"episode": 1})
        over = False
        while not over:
            _, _, terminated, truncated, info = alone.step(alone.hold())
            over = terminated or truncated
        for key in ("state_hash", "verdicts", "metrics", "seed", "clip"):
            self.assertEqual(infos["robot"]["row"][key], info["row"][key], key)

    def test_a_partner_who_stands_still_is_seen_to(self):
        env = self.env()
        env.reset(seed=1)
        before = env._batch.view("partner")[0].copy()
        for _ in range(20):
            env.step({agent: env.hold(agent) for agent in env.agents})
        self.assertTrue((env._batch.view("partner")[0] == before).all())

    def test_what_cannot_be_an_action_is_refused_and_nothing_moves(self):
        env = self.env()
        _, infos = env.reset(seed=1)
        good = self.as_in_the_clip(env, infos)
        with self.assertRaisesRegex(ValueError, r"expected an action of each of \['robot', 'partner'\], found \['robot'\]"):
            env.step({"robot": good["robot"]})
        with self.assertRaisesRegex(ValueError, "partner: expected finite numbers"):
            env.step({**good, "partner": numpy.full((10, 24, 3), numpy.nan)})
        with self.assertRaisesRegex(ValueError, r"expected partners of shape \(1, 10, 24, 3\), found \(1, 5, 24, 3\)"):
            env.step({**good, "partner": good["partner"][:5]})
        self.assertEqual(env._batch.view("tick").tolist(), [0])
        batch = duet.Batch(self.suite(), n=1)
        self.addCleanup(batch.close)
        batch.reset()
        with self.assertRaisesRegex(ValueError, "expected no partners: in this batch they follow their clips"):
            batch.step(batch.view("hold"), good["partner"][None])
        with self.assertRaisesRegex(ValueError, "found 'partner_ahead'"):
            batch.view("partner_ahead")


if __name__ == "__main__":
    unittest.main()
