"""duet from Python, in one minute: two people, a robot in the place of one, a policy of one's own, a comparison.

    python3 examples/python/tutorial.py [FOLDER]
"""

import sys
import tempfile

import numpy

import duet


def hold(observations):
    """Stands still: the null policy. B episodes wait; each gets five poses for the next two seconds."""
    return observations.hold()


def raise_right_hand(observations):
    """Lifts the right arm over the first second, whatever the partner does."""
    plans = observations.hold()
    shoulder = 7 + observations.joints.index("right_shoulder_pitch_joint")
    seconds = observations.tick[:, None] / 50.0 + 0.5 * numpy.arange(5)
    plans[:, :, shoulder] -= 1.6 * numpy.clip(seconds, 0.0, 1.0)
    return plans


def main(folder):
    # Two people wave; PAIR puts the robot in the place of one of them. Arrays are views: nothing is copied.
    people = duet.synthesize("wave", seed=1)
    motion = duet.retarget(people, options={"mode": "best"})
    print(f"{people.id}: {people.a.shape[0]} frames of two people, {motion.q.shape[1]} joints of the robot")
    print("a wave, says the detector:", duet.detect(motion, "wave")["success"])
    print("joint position error [mm]:", round(1000 * duet.score(motion)["metrics"]["jpe"], 1))

    # Policies of one's own in the benchmark: the rows are those of the command line, resumable and comparable.
    settings = {"clips.synth.per_task": 2, "record.trajectories": "all"}
    run = duet.evaluate({"hold": hold, "raise": raise_right_hand, "replay": "replay"}, "demo", engines=["playback"],
                        controllers=["vmc"], tasks=["wave", "high_five"], jobs=4, settings=settings, output=folder)
    print(run.table())
    print(run.compare("raise", "hold"))

    # The results of an episode: its row, and its motion as arrays.
    row = next(row for row in run.episodes if row["policy"] == "raise")
    recording = run.recording(row["key"])
    right_hand = recording["q_target"][:, 22]
    print(f"{row['task']} ended {row['outcome']}: {recording.q.shape[0]} frames, shoulder to {right_hand.min():.2f} rad")

    # The same episodes step by step, as reinforcement learning has them.
    env = duet.make_env("demo/wave", engine="playback", controller="vmc", settings={"clips.synth.per_task": 2})
    observation, info = env.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = env.step(env.hold())
    print("standing still is no wave:", info["is_success"])
    env.close()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(sys.argv[1])
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(scratch + "/run")
