"""Attacks on the second process of a design: whatever becomes of it, and of what is kept, the files are the same.

    python -m tests.bench.beside [ROUNDS [SEED [TARGET]]]

The files to compare with are those of a process with one processor, which begins no second one. Linux alone: who is
whose child is read from /proc. A process that is begun anew shares no memory, so nothing here hangs on how processes
are begun (fork, spawn) or on shared memory.
"""

import contextlib
import hashlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from heatertune.chain import precompile
from heatertune.compiled import dispatch

_LEFT_S = 5.0  # in which the second process has to be gone after the first one


def command(target, cache, out):
    """Begin a design."""
    return subprocess.Popen(
        [sys.executable, "-m", "heatertune", "design", "table4", "--target", target, "--out", str(out)],
        env=os.environ | {"HEATERTUNE_CACHE": str(cache)}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def digest(folder):
    """Return a digest of the files in a folder, names included."""
    told = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        told.update(f"{path.relative_to(folder)}\n".encode() + (path.read_bytes() if path.is_file() else b""))
    return told.hexdigest()


def child_of(process):
    """Return the process that another one began, when there is one; None where that ended before."""
    place = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    while process.poll() is None:
        try:
            if told := place.read_text().split():
                return int(told[0])
        except OSError:
            return None
        time.sleep(0.005)
    return None


def runs(pid):
    """Return whether a process is there, and not only its end that nobody has asked for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class Round:
    """One design in a folder of its own, attacked."""

    def __init__(self, place, kept, target, chance):
        self.target, self.chance = target, chance
        self.cache, self.out = place / "cache", place / "out"
        shutil.copytree(kept, self.cache)
        os.environ["HEATERTUNE_CACHE"] = str(self.cache)
        loops = {dispatch._place(loop) for _, loop in precompile._loops(target)}
        self.loops = [path for folder in loops for path in folder.rglob("*.nb?")]

    def forget(self):
        """Remove the loops' machine code, and what was compared: there is more to do."""
        for path in (*self.loops, *self.cache.glob("comparison-*")):
            path.unlink()

    def ended(self, process, out=None):
        """Return the files' digest, and what was told on the way where it did not end well."""
        told = process.communicate()[1]
        well = process.returncode in (0, 1) and "Traceback" not in told
        return digest(out or self.out) if well else f"status {process.returncode}: {told[-2000:]}"

    def later(self, work):
        """Do something to the second process at a random instant."""
        process = command(self.target, self.cache, self.out)

        def attack():
            pid = child_of(process)
            time.sleep(self.chance.choice((0.2, 1.0, 8.0)) * self.chance.random())
            if pid is not None and process.poll() is None:
                with contextlib.suppress(OSError):
                    work(pid)

        thread = threading.Thread(target=attack)
        thread.start()
        found = self.ended(process)
        thread.join()
        return [found]

    def killed(self):
        self.forget()
        return self.later(lambda pid: os.kill(pid, signal.SIGKILL))

    def killed_drawing(self):
        return self.later(lambda pid: os.kill(pid, signal.SIGKILL))

    def stopped_drawing(self):
        return self.later(lambda pid: os.kill(pid, signal.SIGSTOP))

    def full_disk(self):
        self.forget()
        return self.later(lambda pid: resource.prlimit(pid, resource.RLIMIT_FSIZE, (1_000, 1_000)))

    def cache_removed(self):
        self.forget()
        return self.later(lambda _: shutil.rmtree(self.cache, ignore_errors=True))

    def no_cache(self):
        shutil.rmtree(self.cache)
        self.cache.write_text("no folder")
        return [self.ended(command(self.target, self.cache, self.out))]

    def torn(self):
        for path in self.loops:
            content = path.read_bytes()
            path.write_bytes(content[:int(len(content) * self.chance.choice((0.0, self.chance.random())))])
        return [self.ended(command(self.target, self.cache, self.out)) for _ in range(2)]

    def two_at_once(self):
        self.forget()
        outs = self.out, self.out.with_name("other")
        return [self.ended(process, out) for process, out in [(command(self.target, self.cache, out), out) for out in outs]]

    def first_killed(self):
        self.forget()
        process = command(self.target, self.cache, self.out)
        pid = child_of(process)
        time.sleep(4.0 * self.chance.random())
        process.kill()
        process.communicate()
        until = time.monotonic() + _LEFT_S
        while pid is not None and runs(pid):
            if time.monotonic() > until:
                return ["the second process still runs"]
            time.sleep(0.01)
        return [self.ended(command(self.target, self.cache, self.out))]


ATTACKS = (Round.killed, Round.killed_drawing, Round.stopped_drawing, Round.full_disk, Round.cache_removed, Round.torn,
           Round.two_at_once, Round.first_killed)


def main(rounds=10, seed=0, target="on-off"):
    chance, failed = random.Random(int(seed)), 0
    with tempfile.TemporaryDirectory() as folder:
        kept, right = Path(folder) / "kept", Path(folder) / "right"
        processors = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {min(processors)})
        for _ in range(2):  # the second time with what the first one kept
            command(target, kept, right).communicate()
        os.sched_setaffinity(0, processors)
        wanted = digest(right)
        for number in range(int(rounds)):
            for attack in (*ATTACKS, *([Round.no_cache] if number == 0 else [])):
                with tempfile.TemporaryDirectory() as own:
                    begun = time.monotonic()
                    found = attack(Round(Path(own), kept, target, chance))
                    told = "the same" if set(found) == {wanted} else f"OTHER: {found}"
                    failed += told != "the same"
                    print(f"{number} {attack.__name__} {time.monotonic() - begun:.1f} s: {told}", flush=True)
    print(f"{failed} failed")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
