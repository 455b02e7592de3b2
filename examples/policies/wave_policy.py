"""Stands where it starts and, while the partner is near, waves with the right hand."""
import math

from duet_policy import serve

RAISED = {"right_shoulder_pitch_joint": -1.2, "right_shoulder_roll_joint": -0.5, "right_elbow_joint": 0.2}
SWING, RATE_HZ = 0.5, 0.5  # of the shoulder's yaw [rad]; anchors 0.5 s apart hold no faster one
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
        swing = {"right_shoulder_yaw_joint": SWING * math.cos(2 * math.pi * RATE_HZ * time)}
        pose = {**self.neutral, **RAISED, **swing} if near else self.neutral
        return self.root + [pose[name] for name in self.joints]


serve(Wave)
