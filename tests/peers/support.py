"""What the peer tests share: the program under test, processes that end with the test, and words for what is absent.

A test that needs an absent tool is skipped in so many words, unless BERTH_REQUIRE has the word `peers`: then it fails."""

import json
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PEERS = os.path.join(ROOT, "tests", "peers")
BERTH = os.environ.get("BERTH_BINARY", os.path.join(ROOT, "build", "test", "berth"))
PATIENCE = 60.0  # seconds; a test never waits longer for anything, and a busy machine needs some


def example(name):
    return os.path.join(ROOT, "examples", name)


def absent(why):
    if "peers" in os.environ.get("BERTH_REQUIRE", "").split(","):
        raise AssertionError(f"BERTH_REQUIRE has peers: {why}")
    raise unittest.SkipTest(why)


def need(*programs):
    """Debian package and program have one name here."""
    for program in programs:
        if shutil.which(program) is None:
            absent(f"{program} is not installed (apt-get install {PACKAGE.get(program, program)})")


PACKAGE = {"node": "nodejs", "candump": "can-utils", "canplayer": "can-utils", "slcanpty": "can-utils",
           "log2asc": "can-utils", "asc2log": "can-utils"}


def berth(*arguments, status=0, timeout=PATIENCE, stdin=None):
    """Runs `berth` to its end and gives its standard output."""
    done = subprocess.run([BERTH, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, input=stdin)
    if status is not None and done.returncode != status:
        raise AssertionError(f"berth {' '.join(map(str, arguments))}: status {done.returncode}, expected {status}\n"
                             f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    return done.stdout


def berth_json(*arguments, status=0, **more):
    return json.loads(berth(*arguments, "--json", status=status, **more))


def has_command(name):
    return subprocess.run([BERTH, name, "--help"], capture_output=True).returncode == 0


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def until(condition, what, patience=PATIENCE, step=0.02):
    """Waits for a condition to give something true, and gives it."""
    end = time.monotonic() + patience
    while True:
        result = condition()
        if result:
            return result
        if time.monotonic() > end:
            raise AssertionError(f"not within {patience:.0f} s: {what}")
        time.sleep(step)  # between two looks; nothing rests on it


class Running:
    """A process that ends with the test that started it. What it says goes to a file, so it never blocks."""

    def __init__(self, test, *command):
        self.said = tempfile.TemporaryFile(mode="w+")
        self.name = os.path.basename(command[0])
        self.process = subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=self.said,
                                        stderr=subprocess.STDOUT)
        test.addCleanup(self.stop)

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(5)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        return self.process.returncode

    def alive(self):
        return self.process.poll() is None

    def output(self):
        self.said.flush()
        with open(f"/proc/self/fd/{self.said.fileno()}") as again:
            return again.read()


class Case(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        if not os.path.exists(BERTH):
            self.fail(f"{BERTH} is not there: build it first (./run test does)")
        self.folder = tempfile.mkdtemp(prefix="berth-peers-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w") as file:
            file.write(text)
        return self.path(name)
