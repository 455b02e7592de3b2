"""Two Slurm nodes on this machine, on loopback, with daemons, keys and logs of their own in one folder."""

import contextlib
import getpass
import os
import random
import shutil
import signal
import socket
import subprocess
import time

DAEMONS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "sinfo")

CONFIGURATION = """ClusterName=duet
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={dir}/munge.socket
CredType=cred/munge
StateSaveLocation={dir}/state
SlurmdSpoolDir={dir}/spool-%n
SlurmctldPidFile={dir}/slurmctld.pid
SlurmdPidFile={dir}/slurmd-%n.pid
SlurmctldLogFile={dir}/slurmctld.log
SlurmdLogFile={dir}/slurmd-%n.log
SlurmctldPort={port}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MpiDefault=none
SlurmctldTimeout=10
SlurmdTimeout=10
KillWait=10
MinJobAge=300
MailProg=/bin/true
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={port1} CPUs=1 State=UNKNOWN
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={port2} CPUs=1 State=UNKNOWN
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """Programs of Slurm that this machine lacks."""
    return [name for name in DAEMONS if shutil.which(name) is None]


def pid_in(path):
    with contextlib.suppress(OSError, ValueError):
        with open(path, encoding="ascii") as file:
            return int(file.read())
    return 0


def kill_hard(pid):
    if pid > 0:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def processes_with(text):
    """Numbers of the processes whose command line contains this."""
    found = []
    for name in os.listdir("/proc"):
        if not name.isdigit() or int(name) == os.getpid():
            continue
        with contextlib.suppress(OSError):
            with open(f"/proc/{name}/cmdline", "rb") as file:
                if text in file.read().replace(b"\0", b" ").decode(errors="replace"):
                    found.append(int(name))
    return found


class Nodes:
    """Started by start(); stop() leaves no process behind."""

    def __init__(self, folder):
        self.folder = folder
        os.makedirs(folder + "/state")
        port = random.SystemRandom().randrange(20000, 50000, 10)
        with open(folder + "/slurm.conf", "w", encoding="utf-8") as file:
            file.write(CONFIGURATION.format(dir=folder, host=socket.gethostname().split(".")[0], user=getpass.getuser(),
                                            port=port, port1=port + 1, port2=port + 2))
        with open(folder + "/munge.key", "wb") as file:
            file.write(os.urandom(1024))
        os.chmod(folder + "/munge.key", 0o400)
        self.environment = dict(os.environ, SLURM_CONF=folder + "/slurm.conf")

    def command(self, *words, check=True):
        ended = subprocess.run(words, env=self.environment, capture_output=True, text=True, check=False, timeout=60)
        if check and ended.returncode != 0:
            raise RuntimeError(f"{' '.join(words)}: {ended.stderr.strip() or ended.stdout.strip()}")
        return ended.stdout

    def start(self):
        self.command("munged", "--force", f"--key-file={self.folder}/munge.key", f"--socket={self.folder}/munge.socket",
                     f"--pid-file={self.folder}/munged.pid", f"--log-file={self.folder}/munged.log",
                     f"--seed-file={self.folder}/munge.seed")
        self.start_controller()
        for node in ("n1", "n2"):
            self.start_node(node)
        self.wait_for(lambda: self.states() == {"n1": "idle", "n2": "idle"}, 60, "two idle nodes")

    def start_controller(self):
        self.command("slurmctld")
        self.wait_for(lambda: "UP" in self.command("scontrol", "ping", check=False), 30, "slurmctld")

    def start_node(self, node):
        os.makedirs(f"{self.folder}/spool-{node}", exist_ok=True)
        self.command("slurmd", "-N", node)

    def states(self):
        lines = self.command("sinfo", "-h", "-N", "-o", "%N %t", check=False).split("\n")
        return dict(line.split()[:2] for line in lines if line.strip())

    def wait_for(self, holds, seconds, what):
        until = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > until:
                raise RuntimeError(f"waited {seconds} s for {what}: {self.states()} {self.queue()}")
            time.sleep(0.2)

    def queue(self):
        """Lines of what has not ended, an array's tasks each for itself."""
        return [line for line in self.command("squeue", "-h", "-r", "-o", "%i %T %N %r", check=False).split("\n") if line]

    def wait_for_end(self, seconds=400):
        """Slurm waits two minutes before it starts again what it has put back: here that is three seconds. At once is
        too early: a job that a dead node held then begins on no node (`lacks assigned nodes` in slurmctld.log) and
        stays so until its time limit."""
        put_back = {}

        def over():
            waiting = self.queue()
            for job in (line.split()[0] for line in waiting if line.endswith("BeginTime")):
                if time.monotonic() - put_back.setdefault(job, time.monotonic()) > 3:
                    self.command("scontrol", "update", f"jobid={job}", "StartTime=now", check=False)
                    del put_back[job]
            return not waiting
        self.wait_for(over, seconds, "the end of all jobs")

    def node_pid(self, node):
        return pid_in(f"{self.folder}/slurmd-{node}.pid")

    def kill_node(self, node):
        """slurmd alone."""
        kill_hard(self.node_pid(node))

    def kill_node_with_steps(self, node, run):
        """The machine itself, as far as jobs can tell: slurmd, the steps on it, and the workers."""
        kill_hard(self.node_pid(node))
        for pid in processes_with("slurmstepd"):
            with contextlib.suppress(OSError):
                with open(f"/proc/{pid}/environ", "rb") as file:
                    if self.folder.encode() not in file.read():
                        continue
                kill_tree_of(pid, node, run)

    def stop(self):
        with contextlib.suppress(RuntimeError, subprocess.TimeoutExpired):
            self.command("scancel", "--user", getpass.getuser(), check=False)
            self.command("scontrol", "shutdown", check=False)
            time.sleep(1)
        for name in ("slurmctld", "slurmd-n1", "slurmd-n2", "munged"):
            kill_hard(pid_in(f"{self.folder}/{name}.pid"))


def environment_of(pid):
    with contextlib.suppress(OSError):
        with open(f"/proc/{pid}/environ", "rb") as file:
            return dict(part.split("=", 1) for part in file.read().decode(errors="replace").split("\0") if "=" in part)
    return {}


def workers_of(run, node=None):
    """Processes that work on this run, on this node."""
    found = []
    for pid in processes_with(f"work {run} --shard"):
        with contextlib.suppress(OSError):
            if not os.readlink(f"/proc/{pid}/exe").endswith("duet"):
                continue
            if node is None or environment_of(pid).get("SLURMD_NODENAME") == node:
                found.append(pid)
    return found


def parent_of(pid):
    with contextlib.suppress(OSError, IndexError, ValueError):
        with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
            return int(file.read().rsplit(")", 1)[1].split()[1])
    return 0


def kill_tree_of(stepd, node, run):
    """A step and what it started, where one of these works on the run on this node."""
    family = {stepd}
    for _ in range(4):
        family |= {int(name) for name in os.listdir("/proc") if name.isdigit() and parent_of(int(name)) in family}
    if family & set(workers_of(run, node)):
        for pid in family:
            kill_hard(pid)
