import json
import os
import signal
import subprocess
import sys
import threading
import time
import unittest
import warnings

import numpy

import duet
from support import ScratchTest, main_arm, repeatable


def hold(observations):
    return observations.hold()


def quiet_evaluate(*arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return duet.evaluate(*arguments, **options)


class Rows(ScratchTest):
    def test_rows_of_a_named_policy_are_those_of_the_command_line_to_the_bit(self):
        suite = self.suite(engines="mujoco, playback", controllers="wbc_sim", policies="dstar, replay", more="start_radius: 1.0\n")
        self.command("run", suite, "--policies", "dstar", "-o", self.path("cli"), "-q")
        duet.evaluate("dstar", suite, output=self.path("python"), jobs=2)
        def rows(folder):
            with open(self.path(folder + "/episodes.jsonl"), encoding="utf-8") as file:
                return {row["key"]: repeatable(row) for row in map(json.loads, file)}
        cli, python = rows("cli"), rows("python")
        self.assertEqual(len(cli), 8)
        self.assertEqual({row["policy"] for row in cli.values()}, {"dstar", "null"})
        self.assertEqual(cli, python)

    def test_either_resumes_what_the_other_began(self):
        suite = self.suite(policies="replay")
        self.command("run", suite, "--tasks", "wave", "-o", self.path("run"), "-q")
        run = duet.evaluate(None, suite, output=self.path("run"))
        self.assertEqual(run.summary["already_there"], 2)
        self.assertEqual(run.summary["run_now"], 2)
        self.assertIn("4 of 4 episodes", subprocess.run(
            [os.environ["DUET_PROGRAM"], "run", suite, "-o", self.path("run")], capture_output=True, text=True, check=True).stderr)

    def test_a_function_that_holds_is_the_null_policy_to_the_bit(self):
        run = duet.evaluate(hold, self.suite(engines="mujoco, playback", controllers="vmc"), output=self.path("run"))
        null = {(row["engine"], row["task"], row["clip"]): row for row in run.episodes if row["arm"] == "null"}
        mine = main_arm(run)
        self.assertEqual(len(mine), 4)
        for row in mine:
            of_null = null[row["engine"], row["task"], row["clip"]]
            self.assertEqual(row["state_hash"], of_null["state_hash"])
            self.assertEqual(row["metrics"], of_null["metrics"])
            self.assertEqual(row["policy"], "hold")
            self.assertNotEqual(row["key"], of_null["key"])

    def test_batches_change_no_row(self):
        suite = self.suite(per_task=3)
        rows = {}
        for jobs in (1, 6):
            run = duet.evaluate(hold, suite, output=self.path(f"run{jobs}"), jobs=jobs)
            rows[jobs] = {row["key"]: repeatable(row) for row in run.episodes}
        self.assertEqual(rows[1], rows[6])

    def test_a_function_sees_all_waiting_episodes_at_once(self):
        shapes, threads, first = [], set(), []
        def look(observations):
            shapes.append((len(observations), observations.frames.shape, observations.root.shape, observations.start.shape))
            threads.add(threading.get_ident())
            first.extend(int(e) for e, is_first in zip(observations.episode, observations.first) if is_first)
            self.assertEqual(observations.neutral.shape, (29,))
            self.assertEqual(len(observations.joints), 29)
            self.assertTrue(set(observations.task) <= {"wave", "handshake"})
            self.assertTrue(all(prompt for prompt in observations.prompt))
            self.assertTrue((observations.tick % 10 == 0).all())
            self.assertEqual(observations.seed.dtype, numpy.uint64)
            return observations.hold()
        duet.evaluate(look, self.suite(per_task=4), output=self.path("run"), jobs=8, version="1")
        self.assertGreater(max(size for size, _, _, _ in shapes), 1)
        for size, frames, root, start in shapes:
            self.assertEqual((frames, root, start), ((size, 12, 149), (size, 7), (size, 7)))
        self.assertEqual(len(threads), 1)
        self.assertNotIn(threading.get_ident(), threads)
        self.assertEqual(sorted(first), list(range(8)))

    def test_a_version_is_part_of_the_key(self):
        suite = self.suite()
        keys = {version: {row["key"] for row in main_arm(duet.evaluate(hold, suite, output=self.path(version), version=version))}
                for version in ("a", "b")}
        self.assertFalse(keys["a"] & keys["b"])

    def test_several_policies_in_one_run_are_compared(self):
        run = duet.evaluate({"mine": hold, "replay": "replay"}, self.suite(per_task=2), output=self.path("run"))
        self.assertEqual({row["policy"] for row in main_arm(run)}, {"mine", "replay"})
        comparison = run.compare("replay", "mine")
        self.assertEqual([figure["n"] for figure in comparison if figure["name"] == "difference"][-1], 4)
        self.assertIn("replay", str(comparison))
        self.assertIn("mine", str(run.table()))
        self.assertEqual({entry["policy"] for entry in run.table()}, {"mine", "replay", "null"})
        for name in ("leaderboard", "metrics", "engines", "controllers", "contacts"):
            self.assertIsInstance(run.table(name).rows, list)
            self.assertEqual(run.table(name).values["schema"], "duet.analysis/1")
        with self.assertRaisesRegex(ValueError, "unknown table 'nonsense'.*leaderboard.*metrics"):
            run.table("nonsense")
        self.assertEqual(len(run.columns("clip", "success")["success"]), len(run.episodes))
        self.assertIn("12 episodes", repr(run))


class Faults(ScratchTest):
    def faults_of(self, policy, **options):
        return quiet_evaluate(policy, self.suite(), output=self.path("run"), name="mine", version="1", **options)

    def test_an_exception_is_a_row_with_the_last_line_of_the_traceback(self):
        def fails(observations):
            raise ValueError("no such partner")
        with self.assertWarnsRegex(RuntimeWarning, "mine.*no such partner"):
            run = duet.evaluate(fails, self.suite(), output=self.path("run"), name="mine")
        for row in main_arm(run):
            self.assertEqual(row["outcome"], "error")
            self.assertEqual(row["message"], "policy 'mine': tick 0: ValueError: no such partner")
            self.assertTrue(row["policy_faults"]["dead"])
        self.assertTrue(all(row["outcome"] == "ok" for row in run.episodes if row["arm"] == "null"))

    def test_only_the_episode_that_raises_has_the_fault_whatever_is_beside_it(self):
        def fails_on_waves(observations):
            if "wave" in observations.task and observations.tick.max() >= 20:
                for task, tick in zip(observations.task, observations.tick):
                    if task == "wave" and tick >= 20:
                        raise RuntimeError("I do not wave")
            return observations.hold()
        run = quiet_evaluate(fails_on_waves, self.suite(per_task=3), output=self.path("run"), jobs=6, name="mine")
        for row in main_arm(run):
            self.assertEqual(row["outcome"], "error" if row["task"] == "wave" else "ok", row["message"])
            if row["task"] == "wave":
                self.assertEqual(row["message"], "policy 'mine': tick 20: RuntimeError: I do not wave")

    def test_exit_in_a_policy_ends_its_episode_and_not_the_program(self):
        def leaves(observations):
            sys.exit(3)
        rows = main_arm(self.faults_of(leaves))
        self.assertEqual([row["message"] for row in rows], ["policy 'mine': tick 0: SystemExit: 3"] * 2)

    def test_nan_costs_the_plan_and_is_counted(self):
        def not_finite(observations):
            plans = observations.hold()
            plans[:, 2, 10] = numpy.nan
            return plans
        for row in main_arm(self.faults_of(not_finite)):
            self.assertEqual(row["outcome"], "ok")
            self.assertGreater(row["policy_faults"]["invalid"], 5)
            self.assertEqual(row["policy_faults"]["message"],
                             "policy 'mine': tick 0: plan: row 2, number 10: expected a finite number, found nan")

    def test_wrong_shapes_are_named(self):
        cases = {"one anchor": (lambda o: o.hold()[:, :1], r"expected plans of shape \(1, 5, 36\) or \(1, 100, 36\), found \(1, 1, 36\)"),
                 "no batch": (lambda o: o.hold()[0], r"found \(5, 36\)"),
                 "nothing": (lambda o: None, "Error"),
                 "text": (lambda o: "stand", "Error"),
                 "text in an array": (lambda o: o.hold().astype(str), "TypeError: expected an array of numbers, found one of <U"),
                 "complex": (lambda o: o.hold() * 1j, "TypeError: expected an array of numbers, found one of complex128"),
                 "truth": (lambda o: o.hold() > 0.0, "TypeError: expected an array of numbers, found one of bool"),
                 "ragged": (lambda o: [[1.0], [2.0, 3.0]], "Error")}
        for number, (name, (policy, pattern)) in enumerate(cases.items()):
            with self.subTest(name):
                run = quiet_evaluate(policy, self.suite(), output=self.path(f"run{number}"), name="mine", version=name)
                for row in main_arm(run):
                    self.assertEqual(row["outcome"], "error")
                    self.assertRegex(row["message"], pattern)

    def test_a_policy_that_blocks_leaves_rows_and_the_program_goes_on(self):
        release = threading.Event()
        self.addCleanup(release.set)
        def blocks(observations):
            release.wait(60)
            return observations.hold()
        run = self.faults_of(blocks, patience=0.2, jobs=2)
        rows = main_arm(run)
        self.assertEqual(len(rows), 2)
        for row in rows:
            self.assertEqual(row["message"], "policy 'mine': tick 0: no plan within 0.2 s: its function has not come back")

    def test_lists_and_single_precision_are_plans_too(self):
        for number, policy in enumerate((lambda o: o.hold().tolist(), lambda o: o.hold().astype(numpy.float32))):
            run = duet.evaluate(policy, self.suite(), output=self.path(f"run{number}"), name="mine", version=str(number))
            self.assertTrue(all(row["outcome"] == "ok" for row in run.episodes))

    def test_what_is_asked_for_wrongly_is_refused_before_a_run(self):
        suite = self.suite()
        for arguments, options, error, pattern in (
                (("nobody", suite), {}, ValueError, "unknown policy 'nobody'"),
                ((hold, "no_such_suite"), {}, ValueError, "unknown suite 'no_such_suite'"),
                ((hold, self.path("absent.yaml")), {}, duet.InputError, "absent.yaml"),
                ((hold, suite), {"engines": ["mujuco"]}, ValueError, "mujuco"),
                ((hold, suite), {"settings": {"tusks": ["wave"]}}, duet.InputError, "tusks"),
                ((hold, suite), {"settings": {"robot": self.path("no_card.yaml")}}, (duet.InputError, duet.MissingError), "no_card.yaml"),
                ((hold, suite), {"name": "a/b"}, ValueError, "a/b"),
                ((hold, suite), {"name": "replay"}, ValueError, "the suite's own"),
                ((hold, suite), {"jobs": 0}, ValueError, "jobs: expected 1 to 1024, found 0"),
                ((hold, suite), {"jobs": 2.5}, ValueError, "jobs: expected a whole number, found 2.5"),
                ((5, suite), {}, ValueError, "policy: expected a function, a name, or several of them, found int"),
                (([], suite), {}, ValueError, "policy: expected at least one, found none"),
                (({}, suite), {}, ValueError, "policy: expected at least one, found none"),
                (({"a": 5}, suite), {}, ValueError, "policy 'a': expected a function or a name, found int"),
                (([lambda o: o.hold(), lambda o: None], suite), {}, ValueError, "two are named 'python'; a mapping gives each"),
                ((hold, suite), {"patience": -1.0}, ValueError, "patience"),
                (([hold, "replay"], suite), {"name": "two"}, ValueError, "expected one policy, found 2")):
            with self.subTest(pattern), self.assertRaisesRegex(error, pattern):
                duet.evaluate(*arguments, output=self.path("run"), **options)


INTERRUPTED = """
import os, signal, sys, threading, time
import duet
seen, told = 0, False
def slow(observations):
    global seen, told
    seen += len(observations)
    if seen >= 12 and not told and sys.argv[3] == "stop":  # batches of two may step over 12
        told = True
        os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)
    return observations.hold()
try:
    run = duet.evaluate(slow, sys.argv[1], output=sys.argv[2], jobs=2, version="1")
except KeyboardInterrupt:
    print("interrupted")
    sys.exit(1)
print(run.summary["already_there"], run.summary["run_now"], len(run.episodes))
"""


class Interrupts(ScratchTest):
    def test_ctrl_c_leaves_a_run_that_the_same_call_finishes(self):
        suite = self.suite(per_task=3)
        def run(how):
            return subprocess.run([sys.executable, "-c", INTERRUPTED, suite, self.path("run"), how], capture_output=True,
                                  text=True, check=False, timeout=100)
        stopped = run("stop")
        self.assertEqual((stopped.returncode, stopped.stdout), (1, "interrupted\n"), stopped.stderr)
        self.assertLess(len(duet.load_run(self.path("run")).episodes), 12)
        ended = run("finish")
        self.assertEqual(ended.returncode, 0, ended.stderr)
        there, now, rows = map(int, ended.stdout.split())
        self.assertEqual((there + now, rows), (12, 12))

    def test_ctrl_c_does_not_wait_for_a_policy_that_blocks(self):
        script = INTERRUPTED.replace("time.sleep(0.01)", "time.sleep(3600 if seen >= 12 else 0)")
        begin = time.monotonic()
        stopped = subprocess.run([sys.executable, "-c", script, self.suite(per_task=3), self.path("run"), "stop"],
                                 capture_output=True, text=True, check=False, timeout=100)
        self.assertEqual(stopped.stdout, "interrupted\n", stopped.stderr)
        self.assertLess(time.monotonic() - begin, 90)  # and not an hour

    def test_a_child_process_may_evaluate_after_its_parent(self):
        suite = self.suite()
        duet.evaluate(hold, suite, output=self.path("parent"), jobs=2)
        child = os.fork()
        if child == 0:
            run = duet.evaluate(hold, suite, output=self.path("child"), jobs=1)
            os._exit(0 if len(run.episodes) == 4 else 1)
        self.assertEqual(os.waitpid(child, 0)[1], 0)

    def test_evaluations_on_two_threads_do_not_meet(self):
        runs = {}
        def work(name):
            runs[name] = duet.evaluate(hold, self.suite(name=name + ".yaml"), output=self.path(name), jobs=2, version=name)
        threads = [threading.Thread(target=work, args=(name,)) for name in ("a", "b")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual([len(runs[name].episodes) for name in ("a", "b")], [4, 4])


class TorchPolicy(ScratchTest):
    def test_a_module_of_torch_is_a_policy_whose_weights_are_in_the_key(self):
        try:
            import torch
        except ImportError:
            self.skipTest("not run: torch absent")
        class Still(torch.nn.Module):
            def __init__(self, bias):
                super().__init__()
                self.bias = torch.nn.Parameter(torch.full((36,), bias, dtype=torch.float64))
            def forward(self, observations):
                return torch.from_numpy(observations.hold()) + 0.0 * self.bias
        keys = []
        for bias in (0.0, 1.0):
            run = duet.evaluate(Still(bias), self.suite(), output=self.path(f"run{bias}"), jobs=2)
            self.assertTrue(all(row["outcome"] == "ok" for row in run.episodes))
            self.assertEqual({row["policy"] for row in main_arm(run)}, {"Still"})
            keys.append({row["key"] for row in main_arm(run)})
        self.assertFalse(keys[0] & keys[1])


if __name__ == "__main__":
    unittest.main()
