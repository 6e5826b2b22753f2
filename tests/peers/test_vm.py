"""The tests of inside/, each by its name, run in one virtual machine with SocketCAN (tools/vm)."""

import os
import subprocess
import sys
import unittest

import support
from matrix import tried_by

INSIDE = os.path.join(support.PEERS, "inside")
VM = os.path.join(support.ROOT, "tools", "vm")


def machine_says():
    """The machine's own runner: one line a test, what a failure says below it."""
    check = subprocess.run([VM, "--check"], capture_output=True, text=True)
    if check.returncode != 0:
        support.absent(f"the virtual machine cannot be had here: {(check.stdout + check.stderr).strip()}")
    done = subprocess.run([VM, "--timeout", "400", "--", os.path.join(support.PEERS, "run"), "--folder", INSIDE],
                          capture_output=True, text=True, cwd=support.ROOT, stdin=subprocess.DEVNULL,
                          env=dict(os.environ, BERTH_BINARY=support.BERTH))
    outcomes, name = {}, None
    for line in done.stdout.splitlines():
        word, _, rest = line.partition(" ")
        if word in ("passed", "skipped", "FAILED"):
            name = rest.split()[0].rstrip(":")
            outcomes[name] = (word, rest)
        elif name:
            outcomes[name] = (outcomes[name][0], outcomes[name][1] + "\n" + line)
    return outcomes, f"status {done.returncode}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"


class InTheVirtualMachine(support.Case):
    outcomes = None

    def outcome_of(self, name):
        cls = InTheVirtualMachine
        if cls.outcomes is None:
            cls.outcomes, cls.said = machine_says()
        word, text = cls.outcomes.get(name, ("FAILED", f"did not run; {cls.said}"))
        if word == "skipped":
            support.absent(text)
        if word == "FAILED":
            self.fail(text)


def each(suite):
    for test in suite:
        if isinstance(test, unittest.TestSuite):
            yield from each(test)
        else:
            yield test


def stand_in(test):
    """A test out here that tells what came of one in there, and tries what that does."""
    def told(self):
        self.outcome_of(test.id())
    told.tries = tried_by(test)
    return told


sys.path.insert(0, INSIDE)
for found in each(unittest.TestLoader().discover(INSIDE, "test_*.py", top_level_dir=INSIDE)):
    setattr(InTheVirtualMachine, "test_" + found.id().replace(".", "_"), stand_in(found))


if __name__ == "__main__":
    unittest.main()
