import json
import os
import socket
import subprocess
import unittest

import numpy

from duet.bridge import JOINTS, MESSAGE, PARENTS, Bridge, GuardSocket, OneEuroFilter, OnePerson, PersonLog, Seen, smpl_joints
from support import SOURCE, ScratchTest


def standing(x=0.0, y=0.0, z=2.5):
    """Somebody whose bones have lengths that can be, upright in the camera's frame."""
    height = [0.0, 0.07, 0.07, -0.12, 0.45, 0.45, -0.25, 0.85, 0.85, -0.3, 0.9, 0.9, -0.5, -0.42, -0.42, -0.6, -0.45, -0.45,
              -0.2, -0.2, 0.05, 0.05, 0.12, 0.12]
    return numpy.array([[x, y + h, z] for h in height])


def read(message):
    kind, seen, sequence, stamp, *numbers = MESSAGE.unpack(message)
    return {"kind": kind, "seen": seen, "sequence": sequence, "stamp": stamp, "latency": numbers[-1],
            "joints": numpy.array(numbers[:-1]).reshape(JOINTS, 3)}


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Messages(unittest.TestCase):
    def test_a_message_has_the_joints_and_the_latency_from_picture_to_message(self):
        clock = Clock()
        bridge = Bridge(latency=0.02, clock=clock)
        first = read(bridge.message([Seen(standing())], exposed_at=clock.now - 0.08))
        self.assertEqual((first["kind"], first["seen"], len(bridge.message([], 100.0))), (b"DPJ2", 1, 608))
        self.assertAlmostEqual(first["latency"], 0.10)
        self.assertEqual(first["stamp"], 100.0)
        numpy.testing.assert_array_equal(first["joints"], standing())
        self.assertGreater(read(bridge.message([], 100.0))["sequence"], first["sequence"])

    def test_nobody_is_said_to_be_nobody(self):
        self.assertEqual(read(Bridge().message([], 0.0))["seen"], 0)

    def test_the_depth_is_by_the_cameras_own_focal_length(self):
        bridge = Bridge(focal_length=907.0, assumed_focal_length=25000.0)
        joints = read(bridge.message([Seen(standing(z=55.12679))], 0.0))["joints"]
        self.assertAlmostEqual(joints[0, 2], 2.0, places=4)
        numpy.testing.assert_allclose(joints - joints[0], standing() - standing()[0], atol=1e-9)  # of the same size

    def test_what_is_wrong_is_named(self):
        with self.assertRaisesRegex(ValueError, r"expected both or none of them, found one"):
            Bridge(focal_length=907.0)
        with self.assertRaisesRegex(ValueError, r"focal_length: expected a number of pixels above 0, found -1"):
            Bridge(focal_length=-1.0, assumed_focal_length=1.0)
        with self.assertRaisesRegex(ValueError, r"joints: expected shape \(24, 3\), found \(44, 3\)"):
            Bridge().message([Seen(numpy.zeros((44, 3)))], 0.0)


class Bodies(unittest.TestCase):
    def test_joints_follow_their_parents_in_smpls_order(self):
        rest = standing(z=0.0)
        rest[:, 0] = numpy.linspace(-0.1, 0.1, JOINTS)
        still = numpy.broadcast_to(numpy.eye(3), (JOINTS - 1, 3, 3))
        numpy.testing.assert_allclose(smpl_joints(numpy.eye(3), still, rest, [1, 2, 3]), rest + [1, 2, 3])
        turn = numpy.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        bent = still.copy()
        bent[16 - 1] = turn  # the left shoulder: elbow, wrist and hand turn about it
        joints = smpl_joints(numpy.eye(3), bent, rest, [0, 0, 0])
        for joint in range(JOINTS):
            below = joint
            while below not in (16, -1):
                below = PARENTS[below]
            moved = rest[16] + turn @ (rest[joint] - rest[16]) if below == 16 else rest[joint]
            numpy.testing.assert_allclose(joints[joint], moved, atol=1e-12)


class Filter(unittest.TestCase):
    def test_who_stands_is_calmed_and_who_walks_is_not_late(self):
        random = numpy.random.default_rng(1)
        still, walker = OneEuroFilter(), OneEuroFilter()
        noisy, calm, late = [], [], []
        for k in range(300):
            at = k / 30.0
            noisy.append(0.02 * random.standard_normal(3))
            calm.append(still.update(noisy[-1], at))
            late.append(at * 1.0 - walker.update(numpy.array([at * 1.0]), at)[0])
        self.assertLess(numpy.std(calm[30:]), 0.6 * numpy.std(noisy[30:]))
        self.assertLess(max(late), 0.06)  # [m] at 1 m/s
        self.assertLess(numpy.abs(numpy.mean(calm[30:])), 0.005)

    def test_a_constant_stays_to_the_bit(self):
        still = OneEuroFilter()
        for k in range(20):
            numpy.testing.assert_array_equal(still.update(standing(), k / 30.0), standing())


class Identity(unittest.TestCase):
    def setUp(self):
        self.person = OnePerson()

    def choose(self, people, at):
        return self.person.choose([standing(x) for x, _ in people], [track for _, track in people], at)

    def test_the_nearest_is_taken_and_kept_when_another_comes_nearer(self):
        self.assertEqual(self.choose([(1.5, 4), (0.5, 9)], 0.0), 1)
        for k in range(1, 60):
            self.assertEqual(self.choose([(1.5 - 0.025 * k, 4), (0.5, 9)], k / 30.0), 1)
        self.assertEqual(self.person.switches, 0)

    def test_another_number_for_the_same_person_loses_nobody(self):
        self.choose([(0.5, 9), (2.0, 4)], 0.0)
        self.assertEqual(self.choose([(2.0, 4), (0.52, 17)], 0.1), 1)
        self.assertEqual(self.choose([(0.54, None), (2.0, 4)], 0.2), 0)

    def test_a_number_that_goes_to_somebody_else_is_not_followed(self):
        self.choose([(0.5, 9), (2.0, 4)], 0.0)
        self.assertEqual(self.choose([(2.0, 9), (0.5, 4)], 0.1), 1)

    def test_who_is_gone_is_nobody_until_the_patience_ends(self):
        self.choose([(0.5, 9), (3.0, 4)], 0.0)
        self.assertIsNone(self.choose([(3.0, 4)], 0.5))
        self.assertEqual(self.choose([(3.0, 4)], 1.6), 0)
        self.assertEqual(self.person.switches, 1)


class Guards(ScratchTest):
    def test_a_guards_socket_gets_the_message_and_a_missing_one_none(self):
        path = self.path("person.socket")
        waits = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        sender = GuardSocket(path)
        self.assertFalse(sender.send(b"x"))
        waits.bind(path)
        message = Bridge().message([Seen(standing())], 0.0)
        self.assertTrue(sender.send(message))
        self.assertEqual(waits.recv(1000), message)
        sender.close()
        waits.close()

    def test_the_program_takes_what_the_bridge_recorded(self):
        clock = Clock()
        bridge, log = Bridge(focal_length=907.0, assumed_focal_length=25000.0, clock=clock), PersonLog(self.path("a.dpj"))
        for k in range(45):
            clock.now += 1.0 / 30.0
            people = [Seen(standing(x=0.002 * k, z=2.5 * 25000.0 / 907.0), 3)] if k != 20 else []
            self.assertTrue(log.send(bridge.message(people, clock.now - 0.1)))
        log.close()
        camera = os.path.join(SOURCE, "examples", "hardware", "camera.yaml")
        ended = subprocess.run([os.environ["DUET_PROGRAM"], "hw", "see", self.path("a.dpj"), "--config", camera, "--policy", "null",
                                "--task", "wave", "--json"], capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        result = json.loads(ended.stdout)
        self.assertEqual(result["estimates"]["used"], 44)
        self.assertEqual(result["estimates"]["unseen"], 1)
        self.assertTrue(result["tasks"][0]["ran"], result)


if __name__ == "__main__":
    unittest.main()
