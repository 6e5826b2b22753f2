"""The npm package `canopen`, an independent CANopen stack, as a process on a bus that a socketcand server offers."""

import json
import os
import select
import shutil
import subprocess
import time

import support

PROJECT = os.path.join(support.PEERS, "npm")
PLACE = os.path.join(support.ROOT, "build", "peers", "npm")


def install():
    """What package-lock.json says, into build/peers/npm; nothing when it is there."""
    support.need("node", "npm")
    lock = os.path.join(PROJECT, "package-lock.json")
    done = os.path.join(PLACE, "installed-lock.json")
    if os.path.exists(done):
        with open(lock) as wanted, open(done) as present:
            if wanted.read() == present.read():
                return
    os.makedirs(PLACE, exist_ok=True)
    for name in ("package.json", "package-lock.json"):
        shutil.copy(os.path.join(PROJECT, name), PLACE)
    try:
        got = subprocess.run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=PLACE, capture_output=True,
                             text=True, timeout=120)
    except subprocess.TimeoutExpired:
        support.absent("npm ci did not end within two minutes: no npm registry here?")
    if got.returncode != 0:
        support.absent(f"npm ci failed: no npm registry here? {got.stderr.strip().splitlines()[-1:]}")
    shutil.copy(lock, done)


class PeerError(Exception):
    def __init__(self, text, code):
        super().__init__(text)
        self.code = code


class Npm:
    """`js` runs the body of an async function in the peer and gives what it returns, Buffers as hex."""

    def __init__(self, test, port, bus):
        install()
        environment = dict(os.environ, NODE_PATH=os.path.join(PLACE, "node_modules"))
        self.process = subprocess.Popen(["node", os.path.join(PROJECT, "peer.js"), "127.0.0.1", str(port), bus],
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
        test.addCleanup(self.stop)
        self.asked = 0
        self.waiting = b""

    def stop(self):
        self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()

    def js(self, source, patience=support.PATIENCE):
        self.asked += 1
        self.process.stdin.write(json.dumps({"id": self.asked, "js": source}).encode() + b"\n")
        self.process.stdin.flush()
        end = time.monotonic() + patience
        while True:
            line, found, rest = self.waiting.partition(b"\n")
            if found:
                self.waiting = rest
                answer = json.loads(line)
                if answer["id"] != self.asked:
                    continue
                if "error" in answer:
                    raise PeerError(answer["error"], answer.get("code"))
                return answer["value"]
            ready, _, _ = select.select([self.process.stdout], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                raise AssertionError(f"the npm peer did not answer within {patience:.0f} s: {source}")
            more = os.read(self.process.stdout.fileno(), 65536)
            if not more:
                raise AssertionError(f"the npm peer ended: {source}")
            self.waiting += more

    def heard(self, what, **wanted):
        """What it was told of this kind, so far, with these values."""
        return [entry for entry in self.js("return heard") if entry["what"] == what
                and all(entry.get(name) == value for name, value in wanted.items())]

    def wait_for(self, what, **wanted):
        return support.until(lambda: self.heard(what, **wanted), f"the npm peer hears {what} {wanted}", step=0.05)[-1]
