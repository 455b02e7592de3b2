#!/usr/bin/env python3
"""Writes the marked regions of the documents, or with --check says which of them are not what their source prints.

A region stands between two comments of Markdown:

    <!-- figures: SOURCE -->
    ...
    <!-- end -->

SOURCE is one of the tables below with its argument (a folder of results/tables, which a test holds against the published
rows), or `duet ARGUMENTS`: what the program prints. A comment `<!-- long: COMMAND -->` stands above figures that take a long
run, a download or another machine: they are not compared, --long lists them with the command that repeats them.
"""
import argparse
import csv
import json
import pathlib
import random
import re
import shlex
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TASKS = {"hug": "Hug", "handshake": "Handshake", "high_five": "High-five", "wave": "Wave", "bend": "Bend", "fly_kiss": "Fly-kiss"}
ENGINES = {"mujoco": "MuJoCo", "bullet": "Bullet", "ode": "ODE", "simbody": "Simbody", "dart": "DART"}
WORLDS = {**ENGINES, "mujoco3": "MuJoCo 3.14", "physx": "PhysX 5.6", "bullet_own": "Bullet, own world", "dart_own": "DART, own world", "ode_own": "ODE, own world"}
POLICIES = {
    "dstar": "dstar",
    "dp": "dp",
    "dstar_lead": "dstar, network `lead`",
    "dstar_lead+servo": "dstar, network `lead`, with the servo",
    "dstar_lead+servo_wide": "dstar, network `lead`, with the wide servo",
    "dstar_lead+noise": "dstar, network `lead`, noise where told to begin",
    "dp_lead": "dp, network `lead`",
    "dp_lead+noise": "dp, network `lead`, noise where told to begin",
    "dstar_lead+noise+servo_wide": "dstar, network `lead`, noise where told to begin, with the wide servo",
    "dp_lead+noise+servo_wide": "dp, network `lead`, noise where told to begin, with the wide servo",
    "dp_lead+servo": "dp, network `lead`, with the servo",
    "dstar_shuffled": "dstar, partner of another clip",
    "retrieval": "retrieval",
    "replay": "replay (knows the motion)",
    "replay+servo": "replay (knows the motion), with the servo",
    "replay+servo_wide": "replay (knows the motion), with the wide servo",
    "null": "null (stands still)",
}
CONTROLS = {"waiting": "waiting (scripted, told the task, begins when its partner does)", "canned": "canned (scripted, told the task)", "omni": "omni (scripted, never reads the task)", "patient+servo_wide": "patient (scripted), with the wide servo", "waiting+servo_wide": "waiting (scripted, told the task, begins when its partner does), with the wide servo"}
CONDITIONS = ("act", "alone", "touch", "force", "reply", "stands")


class Refused(Exception):
    pass


def rows_of(folder, name):
    path = ROOT / folder / name
    if not path.is_file():
        raise Refused(f"no file {folder}/{name}")
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def percent(text):
    return f"{100 * float(text):.1f}"


def short(text):  # none and all of them have no decimal
    value = f"{100 * float(text):.1f}"
    return value.removesuffix(".0") if value in ("0.0", "100.0") else value


def markdown(header, right, rows):
    marks = ["---:" if r else ":---" for r in right]
    return [f"| {' | '.join(line)} |" for line in [header, marks, *rows]]


def wilson(k, n):
    """The interval that the program gives a rate (statistics/statistics.h)."""
    z, p = 1.959963984540054, k / n
    middle, spread = p + z * z / (2 * n), z * ((p * (1 - p) + z * z / (4 * n)) / n) ** 0.5
    return [f"{100 * x / (1 + z * z / n):.1f}" for x in (max(middle - spread, 0.0), min(middle + spread, 1 + z * z / n))]


def paired(first, second):
    """Mean of `second` less that of `first` over the same episodes in points, with the interval that the program gives it
    (newcombe_paired of statistics/statistics.h)."""
    z, n = 1.959963984540054, len(first)
    both, ahead, behind = (sum((x, y) == pair for x, y in zip(first, second)) for pair in ((True, True), (False, True), (True, False)))
    neither = n - both - ahead - behind
    sides = []
    for k in (both + ahead, both + behind):
        middle, spread = k / n + z * z / (2 * n), z * (k / n * (1 - k / n) / n + z * z / (4 * n * n)) ** 0.5
        low, high = (max(0.0, middle - spread) / (1 + z * z / n), min(1 + z * z / n, middle + spread) / (1 + z * z / n))
        sides.append((k / n - (0.0 if k == 0 else low), (1.0 if k == n else high) - k / n))
    product = (both + ahead) * (behind + neither) * (both + behind) * (ahead + neither)
    determinant = both * neither - ahead * behind
    if determinant > 0:
        determinant = max(determinant - n / 2, 0)
    turn = determinant / product**0.5 if product else 0.0
    reach = [max(x * x - 2 * turn * x * y + y * y, 0) ** 0.5 for x, y in ((sides[0][0], sides[1][1]), (sides[0][1], sides[1][0]))]
    difference = (ahead - behind) / n
    return f"{100 * difference:+.1f} [{100 * (difference - reach[0]):+.1f}, {100 * (difference + reach[1]):+.1f}]"


def figure(rows, file, **keys):
    """The only line with these values; a key that is not named has any."""
    found = [r for r in rows if all(r[key] == value for key, value in keys.items())]
    if len(found) != 1:
        raise Refused(f"{file} has {len(found)} lines with {keys}, expected one")
    return found[0]


def with_interval(line):
    return f"{percent(line['value'])} [{percent(line['low'])}, {percent(line['high'])}]"


def success(folder):
    """Success of each policy in MuJoCo, by task, under the strict thresholds, and under the detectors as the paper prints them."""
    file = f"{folder}/leaderboard.csv"
    rows = [r for r in rows_of(folder, "leaderboard.csv") if r["engine"] == "mujoco"]
    table = []
    ran = {r["policy"] for r in rows}
    for policy, name in ((policy, name) for policy, name in POLICIES.items() if policy in ran):
        def value(task, name="success", of=""):
            return figure(rows, file, policy=policy, task=task, name=name, of=of)
        every, printed = value("all"), float(value("all", of="paper/paper")["value"])
        n = int(every["n"])
        low, high = wilson(round(printed * n), n)
        table.append([name, str(n), with_interval(every), *[short(value(task)["value"]) for task in TASKS],
                      percent(value("all", of="robot/strict")["value"]), value("all", "fell")["value"], f"{percent(printed)} [{low}, {high}]"])
    paper = figure(rows_of(folder, "policies.csv"), f"{folder}/policies.csv", source="paper", policy="D-STAR", task="all", name="paper_success")
    table.append(["the paper's D-STAR", "126", *["-"] * 9, percent(paper["value"])])
    header = ["Policy", "n", "Overall", *TASKS.values(), "strict", "Fell", "printed detectors"]
    return markdown(header, [False] + [True] * 11, table)


def policies_and_controls(ran):
    """Names of those that ran, with what they are: policies, then controls; one that is not known here is a script."""
    known = {**POLICIES, **CONTROLS}
    return {policy: known.get(policy, f"{policy} (scripted)") for policy in [*known, *sorted(ran - set(known))] if policy in ran}


def rule(folder):
    """Success of policies, then of controls, under the rule `interaction`, by task; beside it the detectors of the robot."""
    file, rows, table = f"{folder}/leaderboard.csv", rows_of(folder, "leaderboard.csv"), []
    by_rule = rows_of(folder, "interaction.csv")
    tasks = {task: title for task, title in TASKS.items() if task in {r["task"] for r in rows}}
    for policy, name in policies_and_controls({r["policy"] for r in rows}).items():
        def value(task, name="success", of=""):
            return figure(rows, file, policy=policy, task=task, name=name, of=of)
        every = value("all")
        counts = [f"{value(task)['k']}/{value(task)['n']}" for task in tasks]
        others = [percent(value("all", of=f"robot/{thresholds}")["value"]) for thresholds in ("act", "strict", "paper")]
        early = figure(by_rule, f"{folder}/interaction.csv", policy=policy, task="all", name="false_starts")
        table.append([name, every["n"], with_interval(every), *counts, *others, f"{early['value']}/{early['n']}", value("all", "fell")["value"]])
    header = ["Policy", "n", "interaction", *tasks.values(), "robot/act", "robot/strict", "robot/paper", "False starts", "Fell"]
    return markdown(header, [False] + [True] * (len(header) - 1), table)


def people(folder, run):
    """Success of each policy on recorded people and on synthetic ones like them, by clip; beside it what the detectors that ask for less say of the former."""
    file, rows, table = f"{folder}/people.csv", rows_of(folder, "people.csv"), []
    recorded = [row for row in rows_in(run) if row["tags"]["clip.people"] == "recorded"]
    tasks = {task: title for task, title in TASKS.items() if task in {r["task"] for r in rows}}
    for policy, name in policies_and_controls({r["policy"] for r in rows}).items():
        def value(task, of="recorded", name="success"):
            return figure(rows, file, policy=policy, task=task, of=of, name=name)
        own = [row for row in recorded if row["policy"] == policy]
        less = sum(v["success"] and row["outcome"] == "ok" for row in own for v in row["verdicts"] if (v["version"], v["thresholds"]) == ("robot", "paper"))
        difference = value("all", "", "recorded_minus_synthetic")
        low, high = (f"{100 * float(difference[side]):+.1f}" for side in ("low", "high"))
        table.append([name, str(len(own)), with_interval(value("all")), *[with_interval(value(task)) for task in tasks], f"{100 * less / len(own):.1f}",
                      percent(value("all", name="falls")["value"]), with_interval(value("all", "synthetic")), f"{100 * float(difference['value']):+.1f} [{low}, {high}]"])
    header = ["Policy", "n", "Recorded: overall", *tasks.values(), "robot/paper", "Fell", "Synthetic: overall", "Recorded - synthetic"]
    return markdown(header, [False] + [True] * (len(header) - 1), table)


def rows_in(folder):
    path = ROOT / folder / "episodes.jsonl"
    if not path.is_file():
        raise Refused(f"no file {folder}/episodes.jsonl")
    return [json.loads(line) for line in path.read_text().splitlines()]


def judged(folder):
    """Rows of a run with the verdict of the rule `interaction`."""
    return [(row, next(v for v in row["verdicts"] if v["version"] == "interaction")) for row in rows_in(folder)]


def conditions(folder):
    """In how many episodes of each policy each condition of the rule failed; one episode may fail in several."""
    rows, table = judged(folder), []
    for policy, name in policies_and_controls({row["policy"] for row, _ in rows}).items():
        parts = [verdict["parts"] for row, verdict in rows if row["policy"] == policy]
        table.append([name, str(len(parts)), *[str(sum(not part[one] for part in parts)) for one in CONDITIONS]])
    return markdown(["Policy", "n", *CONDITIONS], [False] + [True] * 7, table)


def partners(solid, yielding):
    """Hugs, handshakes and high-fives that were won beside a partner whom nothing moves and beside one who gives way, episodes of any task that only one of them lets win, touches over a limit, and hugs' peaks."""
    runs, table = [judged(solid), judged(yielding)], []
    touching = ("hug", "handshake", "high_five")

    def both(some):
        return " → ".join(some)

    for policy, name in policies_and_controls({row["policy"] for row, _ in runs[1]}).items():
        ours = [[(row, verdict) for row, verdict in rows if row["policy"] == policy] for rows in runs]
        won = [both(str(sum(v["success"] for r, v in rows if r["task"] == task)) for rows in ours) for task in touching]
        winners = [{(r["clip"], r["seed"]) for r, v in rows if v["success"]} for rows in ours]
        starts = [{(r["clip"], r["seed"]) for r, _ in rows} for rows in ours]
        if starts[0] != starts[1]:
            raise Refused(f"{yielding}: the episodes of {policy} are not those of {solid}")
        only = f"{len(winners[1] - winners[0])} : {len(winners[0] - winners[1])}"
        touched = [[r for r, _ in rows if r["contact_peak_n"] > 0] for rows in ours]
        over = both(f"{sum(r['forces']['human.worst_ratio'] > 1 for r in rows)} of {len(rows)}" for rows in touched)
        peaks = [sorted(r["contact_peak_n"] for r in rows if r["task"] == "hug") for rows in touched]
        median = both(f"{statistics.median(some):.0f}" if some else "-" for some in peaks)
        table.append([name, *won, only, over, median])
    return markdown(["Policy", *[TASKS[task] for task in touching], "only yielding : only solid", "over a limit", "hugs' median peak [N]"],
                    [False] + [True] * 6, table)


def pictured(file):
    """Task, side, what the file says of it, row and verdict of each episode that it shows."""
    chosen = json.loads((ROOT / file).read_text())
    rows = judged(chosen["run"])
    for task, pair in chosen["tasks"].items():
        for side in ("right", "wrong"):
            one = pair[side]
            found = [(row, verdict) for row, verdict in rows
                     if (row["clip"], row["policy"], verdict["success"]) == (one["clip"], one["policy"], side == "right")]
            if len(found) != 1:
                raise Refused(f"{file}: {task}, {side}: expected one episode of {one['policy']} with {one['clip']} that is {side}, found {len(found)}")
            yield task, side, one, *found[0]


def pictures(file):
    """Of each task an episode that is right and one that is wrong: its picture, what is seen, and which conditions fail."""
    table = []
    for task, side, one, _, verdict in pictured(file):
        failed = [f"`{name}`" for name in CONDITIONS if not verdict["parts"][name]]
        cell = f"![{TASKS[task]}, {side}: {one['alt']}](pictures/{task}-{side}.png)<br>`{one['policy']}`: {one['says']}"
        if side == "right":
            table.append([TASKS[task]])
        table[-1].append(f"{cell} **{'Fails ' + ', '.join(failed) if failed else 'All conditions hold'}.**")
    return markdown(["", "right", "wrong"], [False] * 3, table)


def engines(folder):
    """Success of each policy that ran in every engine, and the mean over them."""
    file, rows = f"{folder}/engines.csv", rows_of(folder, "engines.csv")
    table = []
    for policy, name in POLICIES.items():
        rates = {r["engine"]: r["value"] for r in rows if (r["policy"], r["name"]) == (policy, "success")}
        if set(rates) < set(ENGINES):
            continue
        mean = figure(rows, file, policy=policy, name="mean_success")
        table.append([name, *[percent(rates[engine]) for engine in ENGINES], with_interval(mean)])
    return markdown(["Policy", *ENGINES.values(), "mean"], [False] + [True] * 6, table)


def arms_of(folder):
    """Arms of a run's suite in its order, as its rows name them."""
    names = re.findall(r"(?m)^  - (?:\{name: )?(\w+)", (ROOT / folder / "suite.yaml").read_text().split("perturbations:", 1)[1])
    ran = {row["perturbation"] for row in rows_in(folder)}
    return [name for name in names if name in ran]


def actuation(folder):
    """Success in % and falls in each engine under each controller, by policy and arm."""
    rows = [row for row in rows_in(folder) if row["arm"] == "main"]
    groups = dict.fromkeys((row["engine"], row["controller"]) for row in rows)
    columns = {(policy, arm): f"{policy}, `{arm}`" for policy in policies_and_controls({row["policy"] for row in rows}) for arm in arms_of(folder)}
    table = []
    for engine, controller in groups:
        line = [WORLDS.get(engine, f"`{engine}`"), f"`{controller}`"]
        for policy, arm in columns:
            some = [r for r in rows if (r["engine"], r["controller"], r["policy"], r["perturbation"]) == (engine, controller, policy, arm)]
            won = sum(bool(r["success"]) for r in some)
            line.append(f"{short(won / len(some))} [{', '.join(wilson(won, len(some)))}]; {sum(r['fell'] for r in some)} of {len(some)}" if some else "not run")
        table.append(line)
    return markdown(["Engine", "Controller", *columns.values()], [False] * 2 + [True] * len(columns), table)


def partner_of(folder):
    return re.search(r"(?m)^partner: (\w+)", (ROOT / folder / "suite.yaml").read_text())[1]


def blocks(folder, policy):
    """Rows of the policy by arm and engine, each in the order of clips."""
    found = {}
    for row in sorted(rows_in(folder), key=lambda row: (row["clip"], row["episode"])):
        if row["policy"] == policy:
            found.setdefault(row["perturbation"], {}).setdefault(row["engine"], []).append(row)
    return {arm: found[arm] for arm in arms_of(folder)}


def own_worlds(policy, *folders):
    """Success in % and falls by partner, arm and engine, each world of an engine's own beside its parity engine."""
    table, ran = [], {row["engine"] for folder in folders for row in rows_in(folder)}
    engines_in_order = [name for engine in ENGINES for name in (engine, f"{engine}_own") if name in ran]
    for folder in folders:
        for arm, engines_of in blocks(folder, policy).items():
            line = [partner_of(folder), f"`{arm}`"]
            for engine in engines_in_order:
                some = engines_of.get(engine, [])
                won = sum(bool(r["success"]) for r in some)
                line.append(f"{short(won / len(some))} [{', '.join(wilson(won, len(some)))}]; {sum(r['fell'] for r in some)} of {len(some)}" if some else "-")
            table.append(line)
    return markdown(["Partner", "Arm", *[WORLDS[engine] for engine in engines_in_order]], [False] * 2 + [True] * len(engines_in_order), table)


def own_worlds_paired(policy, *folders):
    """The paired differences in points, of success and of falls: own worlds less their parity engines, and for scale parity engines less another."""
    ran = {row["engine"] for folder in folders for row in rows_in(folder)}
    pairs = [(engine, f"{engine}_own") for engine in ENGINES if f"{engine}_own" in ran] + [("mujoco", engine) for engine in ("bullet", "dart", "ode") if engine in ran]
    table = []
    for folder in folders:
        for arm, engines_of in blocks(folder, policy).items():
            for key, what in (("success", "success"), ("fell", "falls")):
                line = [partner_of(folder), f"`{arm}`", what]
                for first, second in pairs:
                    a, b = ({(r["clip"], r["episode"]): bool(r[key]) for r in engines_of.get(name, [])} for name in (first, second))
                    same = [episode for episode in a if episode in b]
                    line.append(f"{paired([a[e] for e in same], [b[e] for e in same])}; {len(same)}" if same else "-")
                table.append(line)
    heads = [f"{WORLDS[second]}, less {WORLDS[first]}" for first, second in pairs]
    return markdown(["Partner", "Arm", "", *heads], [False] * 3 + [True] * len(pairs), table)


def actuation_walkers(folder, program):
    """In how many engines each walker fell, by arm, beside the largest step of the explicit law that the program foretells."""
    steps = {one["controller"]: one for one in json.loads(output([program, "list", "controllers", "--stability", "--json"]))}
    rows, arms, table = [row for row in rows_in(folder) if row["outcome"] != "unsupported"], arms_of(folder), []
    for controller in dict.fromkeys(row["controller"] for row in rows):
        line = [f"`{controller}`", *[f"{1e3 * steps[controller][key]['largest_step_s']:.2g} ms" for key in ("with_armature", "bare")]]
        for arm in arms:
            some = [row for row in rows if (row["controller"], row["perturbation"]) == (controller, arm)]
            line.append(f"{sum(row['fell'] for row in some)}/{len(some)}")
        table.append(line)
    return markdown(["walker", "bound", "bound, bare", *[f"`{arm}`" for arm in arms]], [False] + [True] * (2 + len(arms)), table)


def explained(folder):
    """How much of the way from parity to a world of the engine's own, explicit torques and all, law, armature and step make in parity's engine alone. Intervals
    draw clips again."""
    of = {}
    for row in rows_in(folder):
        of.setdefault((row["engine"], row["controller"], row["policy"], row["perturbation"]), {})[row["clip"]] = (row["outcome"] == "ok" and row["success"], row["fell"])
    draw, table = random.Random(1), []
    for engine in (e for e in ENGINES if any(key[0] == f"{e}_own" for key in of)):
        for policy in dict.fromkeys(key[2] for key in of):
            here, there = ([of.get((e, "wbc_sim", policy, arm), {}) for e, arm in ((engine, "clean"), (world, "explicit_bare_1ms"))] for world in (engine, f"{engine}_own"))
            start, alone, end = here[0], here[1], there[1]
            clips, cells = sorted(start.keys() & alone.keys() & end.keys()), []
            for what in (0, 1):
                def sums(some):
                    return [sum(to[clip][what] - start[clip][what] for clip in some) for to in (end, alone)]
                gap, part = sums(clips)
                again = sorted(b / a for a, b in (sums(draw.choices(clips, k=len(clips))) for _ in range(2000)) if a)
                low, high = again[len(again) // 40], again[-1 - len(again) // 40]
                cells += [f"{100 * gap / len(clips):+.1f}", f"{100 * part / gap:.0f} [{100 * low:.0f}, {100 * high:.0f}]"]
            table.append([f"{WORLDS[engine]}, own world", POLICIES[policy], str(len(clips)), *cells])
    header = ["To", "Policy", "clips", "gap, success [points]", "law + armature + step alone [%]", "gap, falls [points]", "the same of falls [%]"]
    return markdown(header, [False, False] + [True] * 5, table)


def foretold(folders, program):
    """Of how many controllers the static bound foretells in each engine whether they fall in most episodes under the explicit law at 1 ms; of those that stay
    up there under the implicit law."""
    steps = {(one["controller"], one["robot"]): one["bare"]["largest_step_s"] for one in json.loads(output([program, "list", "controllers", "--stability", "--json"]))}
    fell = {}
    for row in (row for folder in folders for row in rows_in(folder) if row["outcome"] != "unsupported"):
        fell.setdefault((row["engine"], row["controller"], row["tags"]["perturbation.actuation"]), []).append(row["fell"])
    falls = {key: 2 * sum(of) > len(of) for key, of in fell.items()}
    table, sums = [], [0, 0, 0]
    for engine in ENGINES:
        some = {c: (steps[c, body_of(c)], does) for (e, c, a), does in falls.items()
                if (e, a) == (engine, "explicit") and (c, body_of(c)) in steps and not falls[e, c, "implicit"]}
        wrong = [[c for c, (step, does) in some.items() if does != (1e-3 > factor * step)] for factor in (1, 2)]
        sums = [a + b for a, b in zip(sums, (len(some), *map(len, wrong)))]
        table.append([ENGINES[engine], str(len(some)), *[cell for of in wrong for cell in (str(len(some) - len(of)), ", ".join(f"`{c}`" for c in of) or "-")]])
    table.append(["all", str(sums[0]), *[cell for of in sums[1:] for cell in (f"{sums[0] - of} ({100 * (1 - of / sums[0]):.0f} %)", "")]])
    return markdown(["Engine", "controllers", "by the bound", "not", "by twice the bound", "not"], [False, True, True, False, True, False], table)


def body_of(controller):
    """The robot of a controller's descriptor; duet's own controllers run on the G1."""
    for folder in ("descriptors", "arena"):
        path = ROOT / "controllers" / folder / f"{controller}.yaml"
        if path.is_file():
            return re.search(r"(?m)^robot: ([\w]+)", path.read_text())[1]
    return "g1"


def arena(folder, engine, actuation):
    """The board of an engine and actuation, best first: the rung that each controller reaches, where it fails first, and how many episodes pass at each."""
    rows = [r for r in rows_of(folder, "arena.csv") if (r["engine"], r["perturbation"]) == (engine, actuation) and r["controller"]]
    if not rows:
        raise Refused(f"{folder}/arena.csv has no row of {engine}, {actuation}")
    rungs, table = sorted({r["of"] for r in rows if r["name"] == "passes"}), []
    for controller in dict.fromkeys(r["controller"] for r in rows):
        of = {(r["of"], r["name"]): r for r in rows if r["controller"] == controller}
        most, fails = of.get(("rung", "reached")), of.get(("rung", "fails_at"))
        cells = [of.get((rung, "passes")) for rung in rungs]
        table.append([f"`{controller}`", f"`{body_of(controller)}`", f"**{float(most['value']):.0f}**" if most else "**none**",
                      fails["text"] if fails else "nowhere", *[f"{r['k']}/{r['n']}" if r else "-" for r in cells]])
    titles = [" ".join(rung.split("_")[1:]) for rung in rungs]
    return markdown(["Controller", "Body", "Reached", "Fails first at", *titles], [False] * 4 + [True] * len(rungs), table)


def arena_engines(actuation, *folders):
    """The rung that each network reaches in each engine, and its mean over the rungs; of the networks that ran in all of them."""
    rows = [r for folder in folders for r in rows_of(folder, "arena.csv") if (r["source"], r["perturbation"], r["of"]) == ("duet", actuation, "rung")]
    engines = [e for e in ("mujoco", "bullet", "ode", "simbody", "dart") if any(r["engine"] == e for r in rows)]
    table = []
    for controller in sorted(dict.fromkeys(r["controller"] for r in rows)):
        of = {(r["engine"], r["name"]): r for r in rows if r["controller"] == controller}
        if any((engine, "mean") not in of for engine in engines):
            continue
        reached = [float(of[e, "reached"]["value"]) if (e, "reached") in of else 0.0 for e in engines]
        means = [float(of[e, "mean"]["value"]) for e in engines]
        cells = [f"{f'{r:.0f}' if r else 'none'}, {short(m)}" for r, m in zip(reached, means)]
        table.append((-sum(reached), -sum(means), [f"`{controller}`", *cells, f"{100 * (max(means) - min(means)):.1f}"]))
    return markdown(["Controller", *engines, "largest difference"], [False] + [True] * (len(engines) + 1), [line for _, _, line in sorted(table)])


def arena_agreement(folder):
    """Whether engines rank controllers alike, over those that are not saturated."""
    rows = [r for r in rows_of(folder, "arena.csv") if r["of"] == "engines"]
    table = []
    for actuation in dict.fromkeys(r["perturbation"] for r in rows):
        of = {r["name"]: r for r in rows if r["perturbation"] == actuation}
        tau, violation = of["mean_tau_b"], of["rank_violation"]
        table.append([actuation, of["controllers"]["value"], of["saturated"]["value"], f"{float(tau['value']):.2f} [{float(tau['low']):.2f}, {float(tau['high']):.2f}]",
                      f"{float(of['lowest_tau_b']['value']):.2f}", with_interval(violation)])
    return markdown(["Actuation", "controllers", "saturated, left out", "mean tau-b", "lowest", "mean maximum rank violation [points]"], [False] + [True] * 5, table)


def arena_order(*boards):
    """The networks that a public benchmark ran, too, in its order, beside the boards (FOLDER:ACTUATION, of MuJoCo): the rung reached and the mean over rungs;
    last, how far the orders agree."""
    header, columns, survival = ["Network", "upright there [s of 90]"], [], {}
    for board in boards:
        folder, actuation = board.split(":")
        rows = rows_of(folder, "arena.csv")
        survival = {r["controller"]: float(r["value"]) for r in rows if r["name"] == "survival"}
        here = [r for r in rows if (r["engine"], r["perturbation"]) == ("mujoco", actuation)]
        header.append(f"`{folder.rpartition('/')[2]}`, {actuation}: reached, mean [%]")
        columns.append(here)
    table = []
    for network, seconds in sorted(survival.items(), key=lambda item: -item[1]):
        cells = []
        for here in columns:
            of = {r["name"]: r for r in here if r["controller"] == network and r["of"] == "rung"}
            cells.append(f"{of['reached']['value'] if 'reached' in of else 'none'}, {percent(of['mean']['value'])}" if of else "-")
        table.append([f"`{network}`", f"{seconds:g}", *cells])
    def agreement(here):
        tau, swapped = (figure(here, "arena.csv", of="public_order", name=name) for name in ("tau_b", "swapped"))
        return f"{float(tau['value']):.2f} [{float(tau['low']):.2f}, {float(tau['high']):.2f}]; {swapped['value']} of {swapped['n']}"
    table.append(["Kendall's tau-b with the order there; pairs swapped", "1", *[agreement(here) for here in columns]])
    return markdown(header, [False] + [True] * (1 + len(columns)), table)


def jitter(folder):
    """Table S4: jitter of the reference and of the robot, and the robot's distance from the reference, ours before the supplement's."""
    rows = [r for r in rows_of(folder, "controllers.csv") if r["policy"].lower() in ("dstar", "d-star", "dp")]
    pairs = {"HF ratio": "hf_ratio", "DOF jerk [rad/s³]": "dof_jerk", "Root jerk [m/s³]": "root_jerk"}
    errors = {"Root error [m / deg]": ("root_error", "root_angle_error"), "Joint error [rad / rad/s]": ("dof_error", "dof_velocity_error")}
    table = []
    for key in dict.fromkeys((r["source"], r["policy"], r["controller"]) for r in rows):
        of = {r["name"]: float(r["value"]) for r in rows if (r["source"], r["policy"], r["controller"]) == key}
        cells = [f"{of[name + '_reference']:.3g} → {of[name]:.3g}" if name == "hf_ratio" else f"{of[name + '_reference']:.0f} → {of[name]:.0f}" for name in pairs.values()]
        cells += [" / ".join(f"{of[name]:.3g}" for name in names) for names in errors.values()]
        table.append([key[1] if key[0] == "duet" else f"{key[1]} (supplement)", key[2], *cells])
    return markdown(["Policy", "Controller", *pairs, *errors], [False, False] + [True] * 5, table)


def perception(folder):
    """Table S9: success by the rule of each policy, its difference to clean over the same episodes; what the printed detectors say; and the supplement's."""
    rows = rows_of(folder, "degradation.csv")
    ours = [r for r in rows if r["source"] == "duet" and r["policy"] != "replay"]
    sizes = {(r["perturbation"]): (r["of"], float(r["value"])) for r in ours if r["name"] == "size"}
    theirs = {(r["of"], float(r["value"])): r["perturbation"] for r in rows if r["source"] == "paper" and r["name"] == "size"}
    printed = {r["perturbation"]: percent(r["value"]) for r in rows if r["source"] == "paper" and r["name"] == "success"}
    policies, table = list(dict.fromkeys(r["policy"] for r in ours)), []
    for perturbation in dict.fromkeys(r["perturbation"] for r in ours if r["perturbation"]):
        of = {(r["policy"], r["name"]): r for r in ours if r["perturbation"] == perturbation}
        cells = []
        for policy in policies:
            against = of.get((policy, "against_clean"))
            less = f" ({100 * float(against['value']):+.1f} [{percent(against['low'])}, {percent(against['high'])}])" if against else ""
            cells.append(percent(of[policy, "success"]["value"]) + less)
        known = printed.get(theirs.get(sizes.get(perturbation), perturbation), "-")
        table.append([f"`{perturbation}`", *cells, percent(of["dstar", "paper_success"]["value"]), known])
    return markdown(["seen with", *[f"`{policy}`" for policy in policies], "`dstar`, printed detectors", "the supplement's D-STAR"],
                    [False] + [True] * (len(policies) + 2), table)


def suites(program):
    """The suites that ship, what each asks, and whether its rows are published."""
    found = json.loads(output([program, "list", "suites", "--json"]))
    table = []
    for suite in found:
        what, question = suite["detail"].split(": ", 1)
        published = (ROOT / "results/published" / suite["name"]).is_dir()
        table.append([f"`{suite['name']}`", question, what, "yes" if published else "no"])
    return markdown(["suite", "question", "version, episodes", "published rows"], [False] * 4, table)


def output(command):
    done = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    if done.returncode != 0:
        raise Refused(f"'{' '.join(map(str, command))}' ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def contents(source, program):
    words = shlex.split(source)
    if words[:1] == ["suites"] and len(words) == 1:
        return suites(program)
    if words[:1] == ["duet"]:
        lines = output([program, *words[1:]]).rstrip("\n").split("\n")
        return lines if any(line.startswith("|") for line in lines) else ["```", *lines, "```"]
    if words[:1] == ["actuation_walkers"] and len(words) == 2:
        return actuation_walkers(words[1], program)
    if words[:1] == ["foretold"] and len(words) > 1:
        return foretold(words[1:], program)
    if words[:1] in (["own_worlds"], ["own_worlds_paired"]) and len(words) > 2:
        return (own_worlds if words[0] == "own_worlds" else own_worlds_paired)(*words[1:])
    if words[:1] == ["arena"] and len(words) == 4:
        return arena(*words[1:])
    if words[:1] == ["arena_engines"] and len(words) > 2:
        return arena_engines(*words[1:])
    if words[:1] == ["arena_order"] and len(words) > 1:
        return arena_order(*words[1:])
    if words[:1] in (["people"], ["partners"]) and len(words) == 3:
        return (people if words[0] == "people" else partners)(*words[1:])
    tables = {"success": success, "engines": engines, "rule": rule, "conditions": conditions, "pictures": pictures,
              "actuation": actuation, "jitter": jitter, "perception": perception, "arena_agreement": arena_agreement, "explained": explained}
    if len(words) == 2 and words[0] in tables:
        return tables[words[0]](words[1])
    raise Refused(f"'{source}' is none of: success FOLDER, engines FOLDER, rule FOLDER, conditions RUN, people FOLDER RUN, partners RUN RUN, arena FOLDER ENGINE ACTUATION, arena_engines ACTUATION FOLDER..., arena_order FOLDER:ACTUATION..., arena_agreement FOLDER, explained RUN, pictures FILE, actuation RUN, jitter FOLDER, perception FOLDER, actuation_walkers RUN, foretold RUN..., own_worlds POLICY RUN..., own_worlds_paired POLICY RUN..., suites, duet ARGUMENT...")


def refreshed(text, program):
    """The text with every region as its source prints it, and for each region its line, source and whether it was so."""
    lines, result, regions = text.split("\n"), [], []
    at = 0
    while at < len(lines):
        result.append(lines[at])
        begin = re.fullmatch(r"<!-- figures: (.+) -->", lines[at])
        at += 1
        if not begin:
            continue
        try:
            end = lines.index("<!-- end -->", at)
        except ValueError:
            raise Refused(f"line {at}: the region '{begin[1]}' has no '<!-- end -->'") from None
        if any(line.startswith("<!-- figures:") for line in lines[at:end]):
            raise Refused(f"line {at}: the region '{begin[1]}' has no '<!-- end -->' before the next begins")
        try:
            new = ["", *contents(begin[1], program), ""]
        except Refused as refused:
            raise Refused(f"line {at}: {refused}") from None
        regions.append((at, begin[1], new == lines[at:end]))
        result += new
        at = end
    return "\n".join(result), regions


def documents():
    found = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("*/*/README.md")]
    return sorted(path for path in found if "build" not in path.parts and "node_modules" not in path.parts)


def list_long(files):
    for path in files:
        for number, line in enumerate(path.read_text().split("\n"), 1):
            if long := re.fullmatch(r"<!-- long: (.+) -->", line):
                print(f"{path.relative_to(ROOT) if path.is_relative_to(ROOT) else path}:{number}: {long[1]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 where a region differs")
    parser.add_argument("--long", action="store_true", help="list the figures that are not compared")
    parser.add_argument("--keys", metavar="FILE", help="print the keys of the episodes that a file of pictures names")
    parser.add_argument("--program", default=str(ROOT / "build/release/duet"))
    parser.add_argument("files", nargs="*", type=pathlib.Path, help="documents (default: all)")
    arguments = parser.parse_args()
    files = [path.resolve() for path in arguments.files] or documents()
    if arguments.long:
        return list_long(files)
    if arguments.keys:
        try:
            return print("\n".join(row["key"] for _, _, _, row, _ in pictured(arguments.keys)))
        except Refused as refused:
            sys.exit(f"figures: {refused}")
    count = stale = 0
    for path in files:
        text = path.read_text()
        try:
            new, regions = refreshed(text, arguments.program)
        except Refused as refused:
            sys.exit(f"figures: {path}, {refused}")
        count += len(regions)
        for line, source, same in regions:
            if not same:
                stale += 1
                print(f"{path}:{line}: {'is not' if arguments.check else 'was not'} what '{source}' prints")
        if new != text and not arguments.check:
            path.write_text(new)
    print(f"figures: {count} regions, {stale} {'differ' if arguments.check else 'written anew'}")
    return 1 if arguments.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
