"""Trace files that others write and read: can-utils' log2asc and asc2log for Vector ASC, tshark for pcapng.

log2asc 2020.11 takes a log whose first seconds are 0 for one that has not begun, and asc2log counts from today when it does
not know the date's language: times are compared by their differences, and the log begins at second 1,600,000,000."""

import subprocess
import unittest

import support
import tshark
import wire
from support import berth


class Formats(support.Case):
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

    def test_asc_of_berth_is_read_by_asc2log(self):
        support.need("asc2log")
        berth("trace", self.log, "-o", self.path("ours.asc"), "-q")
        self.run_tool("asc2log", "-I", self.path("ours.asc"), "-O", self.path("back.log"))
        self.same(self.path("back.log"))

    def test_asc_of_log2asc_is_read_by_berth(self):
        support.need("log2asc")
        bus = self.frames[0].bus
        self.run_tool("log2asc", "-I", self.log, "-O", self.path("theirs.asc"), bus)
        berth("trace", self.path("theirs.asc"), "--to", "candump", "--no-directions", "-o", self.path("back.log"), "-q")
        self.same(self.path("back.log"))

    def test_pcapng_of_berth_is_read_by_tshark(self):
        support.need("tshark")
        expected = tshark.read(self.log)
        self.assertEqual(len(expected), len(self.frames))
        berth("trace", self.log, "-o", self.path("ours.pcapng"), "-q")
        readings = tshark.read(self.path("ours.pcapng"))
        self.assertEqual([(r.id, r.length, r.malformed, r.fields) for r in readings],
                         [(r.id, r.length, r.malformed, r.fields) for r in expected])


if __name__ == "__main__":
    unittest.main()
