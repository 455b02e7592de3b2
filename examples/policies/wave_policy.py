"""Stands where it starts and, while the partner is near, waves with the right hand.

The detector of a wave counts reversals after which the hand moves on by 5 mm within 0.02 s. Five anchors 0.5 s apart
cannot say that, so the plan is dense (wave_policy.yaml) and the swing goes from side to side at an even speed.
"""
import math

from duet_policy import serve

RAISED = {"right_shoulder_pitch_joint": -1.2, "right_shoulder_roll_joint": -0.5, "right_elbow_joint": 0.2}
SWING, RATE_HZ = 0.5, 1.5  # of the shoulder's yaw [rad]
NEAR = 4.0  # [m]


class Wave:
    def __init__(self, hello):
        self.joints, self.anchors = hello["joints"], hello["anchors"]
        self.neutral = dict(zip(self.joints, hello["neutral"]))
        self.seconds = hello["ticks_per_anchor"] / hello["rate_hz"]
        self.channels = {channel["name"]: channel for channel in hello["channels"]}

    def reset(self, episode):
        x, y, z, qw, qx, qy, qz = episode["start"]
        yaw = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        self.root = [x, y, z, math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)]

    def plan(self, observation):
        partner = self.channels["partner_root"]["first"]
        near = math.dist(observation["frames"][-1][partner : partner + 2], self.root[:2]) < NEAR
        time = observation["tick"] / 50
        return [self.anchor(time + i * self.seconds, near) for i in range(self.anchors)]

    def anchor(self, time, near):
        side = abs(4 * (RATE_HZ * time % 1) - 2) - 1  # from 1 to -1 and back
        swing = {"right_shoulder_yaw_joint": SWING * side}
        pose = {**self.neutral, **RAISED, **swing} if near else self.neutral
        return self.root + [pose[name] for name in self.joints]


serve(Wave)
