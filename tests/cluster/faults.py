"""What clusters do to runs. Each trial ends with the rows of one process, or says what differs."""

import contextlib
import glob
import json
import os
import shutil
import signal
import subprocess
import time

import slurm


def undisturbed(trials):
    """An array of workers on two nodes, and the merge that waits for them."""
    run = trials.plan("undisturbed")
    trials.submit(run)
    trials.nodes.wait_for_end()
    nodes = trials.status(run)["nodes"]
    trials.check("both nodes worked", all(nodes.get(node, {}).get("done", 0) > 0 for node in ("n1", "n2")), nodes)
    trials.check_run("the merge of the dependent job", run, merge=False)
    trials.check_run("merged again", run)


def kill_workers(trials):
    """kill -9 of workers at random moments: 100 of them."""
    wanted = 5 if trials.short else 100
    kills = runs = lost = 0
    begin = time.monotonic()
    trials.duet("work", trials.plan("kill-nobody"), "--shard", "1", "-j", "1", "-q")
    longest = time.monotonic() - begin
    most = 4  # kills of a shard in a run: an episode that five workers did not survive is not tried again
    while kills < wanted:
        run = trials.plan(f"kill-workers-{runs}")
        runs += 1
        for shard in range(4):
            for _ in range(min(most, wanted - kills)):
                worker = trials.start(run, shard)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    worker.communicate(timeout=trials.chance.uniform(0.02, longest))
                if worker.poll() is not None:
                    trials.check("a worker ends well", worker.returncode == 0, f"{worker.returncode}")
                    break
                worker.kill()
                worker.communicate()
                kills += 1
        trials.work(run)
        lost = max(lost, most_open(run))
        trials.check_run(f"after {kills} kills", run)
    trials.check("a kill costs an episode at most", lost <= 1, f"{lost} were begun and lost")
    trials.say(f"{kills} kills over {runs} runs; episodes begun and lost by one kill: {lost} at most")


def most_open(run):
    """Episodes that a worker had begun and not done, the most over all journals."""
    most = 0
    for path in glob.glob(run + "/attempts/*/*.log"):
        with open(path, encoding="utf-8", errors="replace") as file:
            lines = [line.split() for line in file]
        begun = {words[1] for words in lines if words[:1] == ["began"]}
        most = max(most, len(begun - {words[1] for words in lines if words[:1] == ["did"]}))
    return most


def kill_slurmd(trials):
    """kill -9 of slurmd alone: its worker goes on, the node comes back."""
    run = trials.plan("kill-slurmd")
    trials.submit(run)
    trials.wait_for_rows(run)
    trials.nodes.kill_node("n1")
    time.sleep(1)
    trials.nodes.start_node("n1")
    trials.nodes.wait_for_end()
    trials.check_run("slurmd killed", run)


def kill_node(trials):
    """kill -9 of slurmd, its step and the worker: the node is down, Slurm puts the shard back."""
    run = trials.plan("kill-node")
    trials.submit(run)
    trials.wait_for_rows(run)
    trials.nodes.wait_for(lambda: slurm.workers_of(run), 60, "a worker")
    node = slurm.environment_of(slurm.workers_of(run)[0]).get("SLURMD_NODENAME", "n1")
    begin = time.monotonic()
    trials.nodes.kill_node_with_steps(node, run)
    trials.nodes.wait_for(lambda: trials.nodes.states().get(node, "").startswith("down"), 120, f"{node} to be down")
    trials.say(f"{node} was down for Slurm {time.monotonic() - begin:.0f} s after it died (SlurmdTimeout 10 s)")
    trials.nodes.start_node(node)
    trials.nodes.wait_for_end()
    trials.check("the dead node cost an episode a worker at most", most_open(run) <= 1, most_open(run))
    trials.check_run("node killed", run)


def restart_controller(trials):
    """Restart of slurmctld while workers work. Jobs that it has not saved are killed as nobody's: it saves them first."""
    run = trials.plan("restart-controller")
    trials.submit(run)
    trials.wait_for_rows(run)
    state, at_work = trials.nodes.folder + "/state/job_state", time.time()
    for line in trials.nodes.queue():
        trials.nodes.command("scontrol", "update", "JobId=" + line.split()[0], "Comment=changed", check=False)
    trials.nodes.wait_for(lambda: os.path.exists(state) and os.path.getmtime(state) > at_work, 60, "a saved state")
    slurm.kill_hard(slurm.pid_in(trials.nodes.folder + "/slurmctld.pid"))
    time.sleep(1)
    trials.nodes.start_controller()
    trials.nodes.wait_for_end()
    trials.check_run("slurmctld restarted", run)


def time_limit(trials):
    """Slurm's signal before the time limit: the worker stops, the task is put back, the shard goes on."""
    run = trials.plan("time-limit", shards=2)
    trials.submit(run)
    trials.nodes.wait_for(lambda: slurm.workers_of(run), 60, "a worker")
    trials.wait_for_rows(run)
    for line in trials.nodes.queue():
        if " RUNNING " in line:
            trials.nodes.command("scancel", "--signal=USR1", "--batch", line.split()[0], check=False)
    trials.nodes.wait_for_end()
    trials.check_run("put back before its time limit", run)


def stopped_worker(trials):
    """SIGSTOP of a worker while its shard is given to another one: both make the same rows."""
    run = trials.plan("stopped-worker")
    first = trials.start(run, 1, SLURMD_NODENAME="n1")
    trials.wait_for_rows(run)
    os.kill(first.pid, signal.SIGSTOP)
    if not trials.short:
        time.sleep(60)
    second = trials.duet("work", run, "--shard", "1", "-j", "1", "-q", variables={"SLURMD_NODENAME": "n2"})
    trials.check("the other worker ends well", second.returncode == 0, second.stderr)
    os.kill(first.pid, signal.SIGCONT)
    first.communicate(timeout=120)
    trials.check("the one that was stopped ends well", first.returncode == 0, first.returncode)
    trials.work(run)
    merged = json.loads(trials.duet("merge", run, "--json").stdout)
    trials.check("both ran the same episodes", merged["folded"] > 0 and merged["violations"] == 0, merged)
    trials.say(f"{merged['folded']} episodes were run by both and are equal: {merged['pairs']}")
    trials.check_run("stopped and given away", run)


def disk_script(folder, size, inner):
    """On a disk of its own, in a mount namespace of its own."""
    return ["unshare", "-m", "bash", "-c", f"mount -t tmpfs -o size={size} tmpfs {folder} && {inner}"]


def can_mount():
    return os.geteuid() == 0 and subprocess.run(
        ["unshare", "-m", "sh", "-c", "mount -t tmpfs tmpfs /mnt"], stderr=subprocess.DEVNULL, check=False).returncode == 0


def full_disk(trials):
    """A disk that is full: workers stop, no episode fails by it, and they go on when there is space."""
    if not can_mount():
        return trials.say("SKIPPED: a small tmpfs (needs root)")
    run = trials.plan("full-disk")
    folder = trials.folder + "/disk"
    os.makedirs(folder)
    size = sum(os.path.getsize(path) for path in glob.glob(run + "/**", recursive=True) if os.path.isfile(path))
    work = f"for s in 0 1 2 3; do {trials.program} work {folder}/run --shard $s -j 1 -q >/dev/null; echo $?; done"
    script = disk_script(folder, size + 160 * 1024, f"cp -r {run} {folder}/run && {work}; mount -o remount,size=200m {folder};"
                         f" {work}; cp -r {folder}/run {trials.folder}/full-disk-done")
    ended = subprocess.run(script, capture_output=True, text=True, check=False, timeout=300)
    codes = ended.stdout.split()
    trials.check("workers on a full disk stop with 2", "2" in codes[:4] and set(codes[:4]) <= {"0", "2"}, f"{codes} {ended.stderr}")
    trials.check("and say why", "No space left on device" in ended.stderr, ended.stderr)
    trials.check("with space they go on", codes[4:] == ["0"] * 4, codes)
    return trials.check_run("full disk", trials.folder + "/full-disk-done")


def read_only(trials):
    """A folder that becomes read-only under its workers."""
    if not can_mount():
        return trials.say("SKIPPED: a disk that becomes read-only (needs root)")
    run = trials.plan("read-only")
    folder = trials.folder + "/locked"
    os.makedirs(folder)
    work = f"for s in 0 1 2 3; do {trials.program} work {folder}/run --shard $s -j 1 -q >/dev/null; echo $?; done"
    script = disk_script(folder, "200m", f"cp -r {run} {folder}/run; {trials.program} work {folder}/run --shard 1 -j 1 -q >/dev/null;"
                         f" echo $?; mount -o remount,ro {folder}; {work}; {trials.program} merge {folder}/run >/dev/null; echo $?;"
                         f" {trials.program} status {folder}/run >/dev/null; echo $?;"
                         f" mount -o remount,rw {folder}; {work}; cp -r {folder}/run {trials.folder}/read-only-done")
    ended = subprocess.run(script, capture_output=True, text=True, check=False, timeout=300)
    wanted = ["0", "2", "0", "2", "2", "2", "0", "0", "0", "0", "0"]
    trials.check("workers and merges are refused with 2, status is not", ended.stdout.split() == wanted, f"{ended.stdout.split()} {ended.stderr}")
    trials.check("and say why", "Read-only file system" in ended.stderr, ended.stderr)
    return trials.check_run("read-only", trials.folder + "/read-only-done")


def torn_lines(trials):
    """A last line that is not whole, of every length."""
    run = trials.plan("torn")
    trials.work(run)
    for path in glob.glob(run + "/attempts/*/*.jsonl"):
        os.truncate(path, trials.chance.randrange(os.path.getsize(path)))
    for path in glob.glob(run + "/attempts/*/*.log"):
        os.truncate(path, trials.chance.randrange(os.path.getsize(path)))
    merged = json.loads(trials.duet("merge", run, "--json").stdout)
    trials.check("the merge says what is missing", merged["missing"] != [], merged)
    trials.work(run)
    trials.check_run("torn lines", run)


def two_merges(trials):
    """Two merges at once, while workers work."""
    run = trials.plan("two-merges")
    workers = [trials.start(run, shard) for shard in range(4)]
    rounds = 0
    read = False
    while any(worker.poll() is None for worker in workers):
        merges = [subprocess.Popen([trials.program, "merge", run, "-q"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                  for _ in range(2)]
        for merge in merges:
            said = merge.communicate(timeout=60)[1]
            trials.check("a merge ends well", merge.returncode == 0, said)
        if not read and os.path.getsize(run + "/episodes.jsonl") > 0:
            report = trials.duet("verify", run, "--partial", "-q", "-k", "1")
            trials.check("what was merged can be read", report.returncode == 0, report.stderr)
            read = True
        rounds += 1
    for worker in workers:
        worker.communicate()
    trials.say(f"{rounds} times two merges while four workers worked")
    trials.check_run("two merges", run)


def wrong_clocks(trials):
    """A node whose clock is an hour off, either way."""
    run = trials.plan("clocks")
    fake = shutil.which("faketime")
    for shard, offset in enumerate(("-1h", "+1h", "-1h", "+1h")):
        words = [trials.program, "work", run, "--shard", str(shard), "-j", "1", "-q"]
        if fake:
            words = [fake, "-f", offset, *words]
        ended = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
        trials.check(f"a worker with its clock {offset} ends well", ended.returncode == 0, ended.stderr)
        for path in glob.glob(f"{run}/attempts/{shard:06}/*"):
            other = time.time() + (3600 if offset[0] == "+" else -3600)
            os.utime(path, (other, other))
    if not fake:
        trials.say("only times of files are an hour off: faketime is not installed")
    trials.check("status counts them", trials.status(run)["complete"], trials.status(run))
    trials.check_run("clocks an hour off", run)


def other_program(trials):
    """A node with another build is refused and leaves nothing."""
    run = trials.plan("other-program")
    other = trials.folder + "/other"
    os.makedirs(other)
    shutil.copy(trials.program, other + "/duet")
    shutil.copytree(os.path.dirname(trials.program) + "/engines", other + "/engines")
    trials.check("a copy is the same program", trials.work(run, program=other + "/duet")[:1] == [0])
    with open(other + "/duet", "ab") as file:
        file.write(b"\0")
    ended = trials.duet("work", run, "--shard", "1", "-q", program=other + "/duet")
    trials.check("another program: 2", ended.returncode == 2 and "was planned with the program" in ended.stderr, ended.stderr)
    trials.work(run)
    trials.check_run("another program", run)


def other_places(trials):
    """Nodes that have the shared folder in different places."""
    run = trials.plan("places")
    for shard in range(4):
        place = f"{trials.folder}/place-{shard}"
        os.symlink(trials.folder, place)
        ended = trials.duet("work", f"{place}/places", "--shard", str(shard), "-j", "1", "-q", cwd="/")
        trials.check(f"place {shard}", ended.returncode == 0, ended.stderr)
    trials.check_run("four places", run)


def terminated(trials):
    """SIGTERM at random moments: exit code 75 within five seconds, and the next worker goes on."""
    run = trials.plan("terminated")
    slowest = 0.0
    for number in range(3 if trials.short else 20):
        worker = trials.start(run, 1 + number % 3)
        time.sleep(trials.chance.uniform(0.1, 0.6))
        begin = time.monotonic()
        worker.terminate()
        said = worker.communicate(timeout=30)[1]
        took = time.monotonic() - begin
        # Before main() has asked for it a signal ends the program, as it does any.
        trials.check("exit code 75, or 0 where it was done", worker.returncode in (75, 0, -signal.SIGTERM), f"{worker.returncode} {said}")
        slowest = max(slowest, took)
    trials.check("within five seconds", slowest < 5.0, slowest)
    trials.say(f"the slowest took {slowest:.2f} s to end")
    trials.work(run)
    trials.check_run("terminated", run)


def two_nodes_against_one(trials):
    """The same run on one node and on two: how much faster."""
    seconds, used = [], []
    for name, more in (("one", ["--sbatch=--nodelist=n1"]), ("two", [])):
        run = trials.plan(f"on-{name}", shards=4)
        begin = time.monotonic()
        trials.submit(run, *more)
        trials.nodes.wait_for_end(600)
        seconds.append(time.monotonic() - begin)
        used.append(sum(node["seconds"] for node in trials.status(run)["nodes"].values()))
        trials.check_run(f"on {name} nodes", run)
    trials.say(f"one node {seconds[0]:.1f} s, two nodes {seconds[1]:.1f} s, start of jobs included: {seconds[0] / seconds[1]:.2f}; "
               f"an episode took {used[1] / used[0]:.2f} times as long on two; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


def examples(trials):
    """The scripts of examples/cluster: a shell loop, GNU parallel, Snakemake, a Slurm array by hand."""
    folder = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../examples/cluster")
    environment = dict(os.environ, DUET=trials.program, THREADS="1", JOBS="2")
    ways = [("loop", "bash", lambda run: ["bash", folder + "/loop.sh", run]),
            ("parallel", "parallel", lambda run: ["bash", folder + "/gnu_parallel.sh", run]),
            ("snakemake", "snakemake", lambda run: ["snakemake", "-s", folder + "/Snakefile", "--cores", "2", "-d", trials.folder,
                                                    "--config", "run=" + run, "duet=" + trials.program])]
    for name, needs, command in ways:
        if not shutil.which(needs):
            trials.say(f"SKIPPED {name}: {needs} is not installed")
            continue
        run = trials.plan("by-" + name)
        ended = subprocess.run(command(run), capture_output=True, text=True, check=False, timeout=600, env=environment)
        trials.check(f"{name} ends well", ended.returncode == 0, ended.stderr[-600:])
        trials.check_run(name, run, merge=False)
        trials.say(f"{name}: all episodes")
    if trials.nodes:
        run = trials.plan("by-array")
        trials.nodes.environment["DUET"] = trials.program
        trials.nodes.command("sbatch", "--array=0-3", f"--output={run}/%a.out", folder + "/array.sh", run)
        trials.nodes.wait_for_end()
        trials.check_run("array by hand", run)


SHORT = [undisturbed, kill_workers, kill_slurmd, restart_controller]
ALL = [undisturbed, kill_workers, kill_slurmd, kill_node, restart_controller, time_limit, stopped_worker, full_disk, read_only,
       torn_lines, two_merges, wrong_clocks, other_program, other_places, terminated, examples, two_nodes_against_one]
NEED_SLURM = [undisturbed, kill_slurmd, kill_node, restart_controller, time_limit, two_nodes_against_one]
