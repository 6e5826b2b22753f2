"""A bus that `berth serve` offers by socketcand, and Berth's own device on it (tests/tools/partner.cpp)."""

import os
import subprocess

import support

PARTNER = os.path.join(os.path.dirname(support.BERTH), "berth_partner")
EMPTY = "[plant]\nseed = 1\n\n[bus.field]\nbitrate = 500_000\n"


class ClassScope:
    """Lets what belongs to one test belong to all tests of a class."""

    def __init__(self, case):
        self.addCleanup = case.addClassCleanup


def serve(test, folder, plant=EMPTY):
    """Offers the buses of a plant file's text; gives the TCP port."""
    if not support.has_command("serve"):
        support.absent("this Berth has no `serve`")
    file = os.path.join(folder, "served.plant.toml")
    with open(file, "w") as out:
        out.write(plant)
    port = support.free_port()
    server = support.Running(test, support.BERTH, "serve", file, "--listen", f"127.0.0.1:{port}")
    support.until(lambda: listening(port) or not server.alive(), "berth serve listens")
    if not server.alive():
        raise AssertionError(f"berth serve ended: {server.output()}")
    return port


def listening(port):
    """From the kernel's table: a connection would already be a client."""
    with open("/proc/net/tcp") as table:
        return any(line.split()[1] == f"0100007F:{port:04X}" and line.split()[3] == "0A" for line in list(table)[1:])


class Partner:
    def __init__(self, test, port, node, serial=1, bus="field"):
        if not os.path.exists(PARTNER):
            raise AssertionError(f"{PARTNER} is not there: build it first (./run test does)")
        self.process = subprocess.Popen([PARTNER, f"socketcand://127.0.0.1:{port}/{bus}", bus, str(node), str(serial)],
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        test.addCleanup(self.stop)
        said = self.process.stdout.readline().strip()
        if said != "ready":
            raise AssertionError(f"berth_partner: {said or 'ended'}")

    def order(self, *words):
        """One SDO transfer as client. Gives the hex of an upload, "" for a download; AssertionError with the reason."""
        print(*words, file=self.process.stdin, flush=True)
        verdict, _, rest = self.process.stdout.readline().strip().partition(" ")
        if verdict != "ok":
            raise AssertionError(rest)
        return rest

    def stop(self):
        try:
            self.process.stdin.close()
        except BrokenPipeError:
            pass
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
