"""Trace files that others write and read: can-utils' log2asc and asc2log for Vector ASC, tshark for pcapng.

log2asc 2020.11 takes a log whose first seconds are 0 for one that has not begun, and asc2log counts from today when it does
not know the date's language: times are compared by their differences, and the log begins at second 1,600,000,000."""

import subprocess
import unittest

import support
import tshark
import wire
from matrix import tries
from support import berth


try:
    import can
except ImportError:
    can = None


class Demo(support.Case):
    """The demo's frames in a candump log that begins at second 1,600,000,000."""

    def setUp(self):
        super().setUp()
        if "--output" not in berth("trace", "--help"):
            support.absent("this `berth trace` converts nothing")
        raw = self.path("raw.log")
        berth("demo", "--fast", "--record", raw)
        self.log = self.path("demo.log")
        with open(raw) as source, open(self.log, "w") as shifted:
            for line in source:
                at, rest = line.split(") ", 1)
                shifted.write(f"({float(at[1:]) + 1_600_000_000:.6f}) {rest}")
        self.frames = wire.read_log(self.log)
        self.assertGreater(len(self.frames), 500)

    def same(self, path, slack=2e-6):
        """Every frame, in its order, with its time after the first one's."""
        back = wire.read_log(path)
        text = [frame.line.split()[2] for frame in self.frames]
        self.assertEqual([frame.line.split()[2] for frame in back], text)
        for ours, theirs in zip(self.frames, back):
            self.assertAlmostEqual(theirs.time - back[0].time, ours.time - self.frames[0].time, delta=slack, msg=theirs.line)

    def run_tool(self, *command):
        done = subprocess.run(command, capture_output=True, text=True, timeout=support.PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)


class Formats(Demo):
    @tries("can-utils", "trace formats")
    def test_asc_of_berth_is_read_by_asc2log(self):
        support.need("asc2log")
        berth("trace", self.log, "-o", self.path("ours.asc"), "-q")
        self.run_tool("asc2log", "-I", self.path("ours.asc"), "-O", self.path("back.log"))
        self.same(self.path("back.log"))

    @tries("can-utils", "trace formats")
    def test_asc_of_log2asc_is_read_by_berth(self):
        support.need("log2asc")
        bus = self.frames[0].bus
        self.run_tool("log2asc", "-I", self.log, "-O", self.path("theirs.asc"), bus)
        berth("trace", self.path("theirs.asc"), "--to", "candump", "--no-directions", "-o", self.path("back.log"), "-q")
        self.same(self.path("back.log"))

    @tries("tshark", "trace formats")
    def test_pcapng_of_berth_is_read_by_tshark(self):
        support.need("tshark")
        expected = tshark.read(self.log)
        self.assertEqual(len(expected), len(self.frames))
        berth("trace", self.log, "-o", self.path("ours.pcapng"), "-q")
        readings = tshark.read(self.path("ours.pcapng"))
        self.assertEqual([(r.id, r.length, r.malformed, r.fields) for r in readings],
                         [(r.id, r.length, r.malformed, r.fields) for r in expected])


class PythonCan(Demo):
    """ASC, TRC and candump logs, written by one and read by the other."""

    def setUp(self):
        super().setUp()
        if can is None:
            support.absent("python3-can is not installed for /usr/bin/python3 (apt-get install python3-can)")

    def without_what_it_drops(self, kind):
        """Its TRC reader passes over remote frames, and its writer leaves them out."""
        return [frame for frame in self.frames if kind != "trc" or not frame.remote]

    KINDS = {"asc": "asc", "trc": "trc", "log": "candump"}

    @tries("python-can", "trace formats")
    def test_what_berth_writes_is_read(self):
        for kind, name in self.KINDS.items():
            with self.subTest(kind):
                berth("trace", self.log, "--to", name, "--no-directions", "-o", self.path("ours." + kind), "-q")
                with can.LogReader(self.path("ours." + kind)) as reader:
                    back = [(f"{m.arbitration_id:03X}", m.is_remote_frame, bytes(m.data), m.timestamp) for m in reader]
                frames = self.without_what_it_drops(kind)
                self.assertEqual([b[:3] for b in back], [(f"{f.id:03X}", f.remote, f.data) for f in frames])
                for (*_, at), frame in zip(back, frames):
                    self.assertAlmostEqual(at - back[0][3], frame.time - frames[0].time, delta=2e-5, msg=frame.line)

    @tries("python-can", "trace formats")
    def test_what_it_writes_is_read_by_berth(self):
        for kind in self.KINDS:
            with self.subTest(kind):
                with can.Logger(self.path("theirs." + kind)) as writer:
                    self.frames = self.without_what_it_drops(kind)
                    for frame in self.frames:
                        length = int(frame.line[-1]) if frame.remote else len(frame.data)
                        writer(can.Message(timestamp=frame.time, arbitration_id=frame.id, data=frame.data, dlc=length,
                                           channel=0, is_extended_id=frame.extended, is_remote_frame=frame.remote))
                berth("trace", self.path("theirs." + kind), "--to", "candump", "--no-directions", "-o",
                      self.path("back.log"), "-q", "--force")
                self.same(self.path("back.log"), slack=2e-3 if kind == "trc" else 2e-5)


if __name__ == "__main__":
    unittest.main()
