"""kill -9 at random moments, and what a resumed run makes of it."""

import os
import random
import time

from common import kill, litter_of, lines_of


def killed_and_resumed(trials):
    """Kills spread over a whole run; after each, the rows that were there are still there, byte for byte."""
    trials.reference()
    chance = random.Random(trials.seed)
    rounds = 2 if trials.short else 12
    kills = lost = torn = 0
    for number in range(rounds):
        out = trials.fresh(f"killed-{number}")
        for _ in range(40):
            before = lines_of(out)
            process = trials.start(trials.command(out, "-j", "2"))
            time.sleep(chance.uniform(0.0, 0.6 * trials.seconds))
            if kill(process) == 0:
                break
            kills += 1
            after = lines_of(out)
            lost += after[: len(before)] != before
            torn += os.path.exists(os.path.join(out, "episodes.jsonl")) and not ends_with_newline(out)
        trials.finish(out)
        trials.check_rows(f"killed run {number}", out)
        trials.check(f"killed run {number}: no half-written file is left", not litter_of(out), litter_of(out))
        trials.check(f"killed run {number}: no clip is kept", not os.path.exists(os.path.join(out, "prepared")))
    trials.check("no kill changes a row that was there", lost == 0, f"{lost} of {kills} kills")
    trials.say(f"kill -9: {kills} kills in {rounds} runs, {torn} left a part of a row")


def ends_with_newline(out):
    with open(os.path.join(out, "episodes.jsonl"), "rb") as file:
        text = file.read()
    return not text or text.endswith(b"\n")


def killed_while_it_prepares(trials):
    """A job that never lives long enough to prepare all clips gets there nevertheless."""
    out = trials.fresh("preparing")
    chance = random.Random(trials.seed + 1)
    more = ["-s", "clips.synth.per_task=" + ("8" if trials.short else "20"), "-s", "perturbations=[clean]", "-j", "1"]
    folder = os.path.join(out, "prepared")
    kills, counts = 0, [0]
    while kills < (10 if trials.short else 40) and not lines_of(out):
        process = trials.start(trials.command(out, *more))
        time.sleep(chance.uniform(0.3, 0.6))
        if kill(process) == 0:
            break
        kills += 1
        if os.path.isdir(folder):
            counts.append(len([name for name in os.listdir(folder) if ".part-" not in name]))
    trials.check("the number of clips that are ready never falls", counts == sorted(counts), counts)
    trials.check("a killed preparation gets on", counts[-1] > 0 or lines_of(out), counts)
    trials.finish(out, *more)
    trials.check("nothing of it is left", not os.path.exists(folder) and not litter_of(out), litter_of(out))
    trials.say(f"kill -9 while clips are prepared: {kills} kills, clips ready: {' '.join(map(str, counts))}")


def damaged_clips(trials):
    """Prepared clips with flipped bits are made anew: the rows are the same."""
    out = trials.fresh("damaged")
    trials.reference()
    process = trials.start(trials.command(out, "-j", "1"))
    folder = os.path.join(out, "prepared")
    until = time.monotonic() + 20
    while time.monotonic() < until and not (os.path.isdir(folder) and len(os.listdir(folder)) > 2):
        time.sleep(0.002)
    kill(process)
    damaged = 0
    for name in os.listdir(folder) if os.path.isdir(folder) else []:
        with open(os.path.join(folder, name), "r+b") as file:
            size = os.fstat(file.fileno()).st_size
            file.seek(size // 3)
            byte = file.read(1)
            file.seek(size // 3)
            file.write(bytes([byte[0] ^ 1]) if byte else b"x")
        damaged += 1
    trials.finish(out)
    trials.check_rows("damaged clips", out)
    trials.say(f"flipped bits in {damaged} prepared clips")


TRIALS = [killed_and_resumed, killed_while_it_prepares, damaged_clips]
