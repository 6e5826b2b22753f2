"""tshark's CANopen dissector as judge of what the test plants put on the bus, and of what `berth trace` reads there."""

import collections
import os
import unittest

import berth_trace
import support
import tshark
import wire
from matrix import tries
from support import berth, example


class Judge(support.Case):
    def setUp(self):
        super().setUp()
        support.need("tshark")

    def judge(self, log):
        """Every frame without a malformed field and read by tshark as by wire.py. Gives how often each kind was there."""
        frames, readings = wire.read_log(log), tshark.read(log)
        self.assertEqual(len(readings), len(frames), f"{log}: frames that tshark shows")
        reader, kinds, excused = wire.Reader(), collections.Counter(), collections.Counter()
        for number, (frame, reading) in enumerate(zip(frames, readings), 1):
            kind, expected = reader.read(frame)
            where = f"{log}:{number}: {frame.line}: {kind}"
            self.assertEqual(reading.id, frame.id, where)
            kinds[kind] += 1
            reason = tshark.known_to_be_wrong(frame, kind)
            if reason:
                excused[reason] += 1
                continue
            self.assertFalse(reading.malformed, where)
            self.assertEqual(reading.fields, expected, where)
        self.assertLess(sum(excused.values()), len(frames))
        self.agree(log, frames, readings)
        return kinds

    def agree(self, log, frames, readings):
        """`berth trace` reads the same as tshark in each frame."""
        reader, compared = wire.Reader(), 0
        rows = berth_trace.rows(log)
        self.assertEqual(len(rows), len(frames), f"{log}: rows of berth trace")
        for number, (frame, reading, row) in enumerate(zip(frames, readings, rows), 1):
            kind, _ = reader.read(frame)
            if not kind or tshark.known_to_be_wrong(frame, kind):
                continue
            values, words = berth_trace.expected(reading)
            where = f"{log}:{number}: {frame.line}: berth trace says {row}; tshark reads {reading.fields}"
            self.assertEqual({name: row.get(name) for name in values}, values, where)
            for word in words:
                self.assertIn(word, row["words"], where)
            compared += bool(values)
        self.assertGreater(compared, 0)

    def seen(self, kinds, *wanted):
        for kind in wanted:
            self.assertGreater(kinds[kind], 0, f"no {kind} in the trace; there were {dict(kinds)}")


class Plants(Judge):
    def up(self, name, *more):
        log = self.path(name + ".log")
        berth("up", example(name + ".toml"), "--sim", example(name + ".plant.toml"), "--fast", "--record", log, *more)
        return self.judge(log)

    @tries("tshark", "NMT", "heartbeat", "LSS", "SDO expedited upload", "SDO expedited download")
    def test_the_demo(self):
        log = self.path("demo.log")
        berth("demo", "--fast", "--record", log)
        self.seen(self.judge(log), "NMT", "boot-up", "error control", "SDO upload", "SDO download", "SDO abort",
                  "LSS switch global", "LSS select", "LSS select answer", "LSS inquire", "LSS inquire answer",
                  "LSS identify non-configured", "LSS node-ID", "LSS node-ID answer", "LSS store", "LSS store answer",
                  "LSS Fastscan")

    def test_devices_made_from_descriptions(self):
        self.seen(self.up("by-eds"), "PDO", "SDO upload", "boot-up")

    @tries("tshark", "PDO", "SDO segmented upload", "SDO segmented download")
    def test_devices_that_are_configured(self):
        self.seen(self.up("configured"), "PDO", "SDO download", "SDO download segment", "SDO upload segment", "NMT")

    def test_a_hundred_and_twenty_devices(self):
        self.seen(self.up("hundred-twenty"), "LSS node-ID", "boot-up", "NMT")

    @tries("tshark", "EMCY", "SYNC", "heartbeat")
    def test_a_plant_by_itself_that_ails(self):
        log = self.path("ailing.log")
        berth("plant", example("ailing.plant.toml"), "--machine", example("ailing.toml"), "--for", "3 s", "--record", log,
              status=1)  # not every device of it can be well
        self.seen(self.judge(log), "EMCY", "SYNC", "error control")

    def test_what_the_papers_show(self):
        folder = self.path("papers")
        berth("reproduce", "--record", folder)
        names = sorted(os.listdir(folder))
        self.assertGreater(len(names), 10)
        log = self.path("papers.log")  # one after the other, in time too: tshark starts slowly
        begin = last = 0.0
        with open(log, "w") as together:
            for name in names:
                begin = last + 1
                with open(os.path.join(folder, name)) as one:
                    for line in one:
                        time, rest = line.split(" ", 1)
                        last = begin + float(time.strip("()"))
                        together.write(f"({last:017.6f}) {rest}")
        kinds = self.judge(log)
        self.seen(kinds, "LSS Fastscan", "LSS identify answer", "LSS inquire answer", "LSS store answer", "boot-up")


class Services(Judge):
    def one(self, *command):
        log = self.path("one.log")
        berth(*command, "--machine", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--record", log,
              "--force")
        return self.judge(log)

    def test_sdo(self):
        self.seen(self.one("sdo", "read", "2", "0x1018", "4", "--type", "u32", "--up"), "SDO upload")
        self.seen(self.one("sdo", "write", "2", "0x1017", "0", "500", "--type", "u16", "--up"), "SDO download")

    def test_nmt(self):
        for word in ("preop", "reset-comm"):
            self.assertGreater(self.one("nmt", word, "2", "--up")["NMT"], 5)  # the five starts, and this one

    @tries("tshark", "LSS")
    def test_lss(self):
        s1 = "01000001-00000001-00000000-0000000A"
        self.seen(self.one("lss", "select", s1), "LSS select", "LSS select answer")
        self.seen(self.one("lss", "inquire", s1), "LSS inquire answer")
        self.seen(self.one("lss", "bit-timing", "125000", s1), "LSS bit timing", "LSS bit timing answer")
        self.seen(self.one("lss", "identify", "0x01000001", "1"), "LSS identify", "LSS identify answer")


if __name__ == "__main__":
    unittest.main()
