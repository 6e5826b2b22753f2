"""DBC files of `berth document`, read by canmatrix: what it makes of a frame is what `berth trace` makes of it."""

import json
import os
import random
import shutil
import sys
import unittest
import warnings

import support
from support import berth, example


def canmatrix_formats():
    sys.path.append("/usr/lib/python3/dist-packages")  # of Debian, whichever Python runs
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import canmatrix.formats
        except ImportError:
            support.absent("canmatrix is not installed (apt-get install python3-canmatrix)")
    return canmatrix.formats


class Dbc(support.Case):
    def read(self, machine):
        """The machine's buses as canmatrix reads them, by the files' names."""
        formats = canmatrix_formats()
        folder = self.path("document")
        path = machine if os.path.isabs(machine) else example(machine)
        files = json.loads(berth("document", path, "-o", folder, "--json"))["files"]
        read = {}
        for path in files:
            if path.endswith(".dbc"):
                matrix = list(formats.loadp(path).values())
                self.assertEqual(len(matrix), 1, path)
                read[path.rsplit("/", 1)[1]] = matrix[0]
        return read

    def test_links_are_signals_with_their_receivers(self):
        bus = self.read("linked.toml")["field.dbc"]
        plan = json.loads(berth("link", example("linked.toml"), "--json"))
        self.assertTrue(plan["pdos"])
        for pdo in plan["pdos"]:
            frame = bus.frame_by_id(pdo_id(pdo["can_id"]))
            self.assertIsNotNone(frame, pdo)
            self.assertEqual(frame.transmitters, [dbc_name(pdo["producer"])])
            places = [(signal.start_bit, signal.size) for signal in frame.signals]
            self.assertEqual(places, [(carried["at"], carried["bits"]) for carried in pdo["objects"]])
            receivers = sorted({dbc_name(each["slot"]) for each in pdo["receivers"]})
            self.assertEqual(sorted({name for signal in frame.signals for name in signal.receivers}), receivers)

    def test_values_are_those_of_berth_trace(self):
        machine = "belt.toml"
        bus = self.read(machine)["field.dbc"]
        frames = [frame for frame in bus.frames if "_TPDO_" in frame.name and frame.signals]
        self.assertTrue(frames)
        words = random.Random(20261128)
        log = self.path("some.log")
        sent = []
        with open(log, "w") as file:
            for n in range(200):
                frame = words.choice(frames)
                data = bytes(words.randrange(256) for _ in range(frame.size))
                sent.append((frame, data))
                file.write(f"({n / 100:.6f}) can0 {frame.arbitration_id.id:03X}#{data.hex().upper()}\n")
        rows = [json.loads(line) for line in
                berth("trace", log, "-m", example(machine), "--frames", "--json").splitlines()]
        rows = [row for row in rows if "frame" in row]
        self.assertEqual(len(rows), len(sent))
        for (frame, data), row in zip(sent, rows):
            theirs = [str(value.raw_value) for value in frame.decode(data).values()]
            self.assertEqual(sorted(theirs), sorted(numbers_of(row)), (frame.name, data.hex(), row))

    def test_notes_are_units_factors_and_names(self):
        """What `berth note write` says of an object, and what a trace says of its value."""
        folder = self.path("noted")
        os.makedirs(folder + "/eds")
        for name in ("belt.toml", "eds/belt.eds", "eds/barrier.eds"):
            shutil.copy(example(name), f"{folder}/{name}")
        machine = folder + "/belt.toml"
        berth("note", "write", "belt", "6000h:01", "-m", machine, "--unit", "boxes", "--scale", "0.5",
              "--value", "4=two", "--value", "255=all")
        bus = self.read(machine)["field.dbc"]
        frame = next(frame for frame in bus.frames if frame.transmitters == ["belt"] and "_TPDO_" in frame.name)
        signal = next(signal for signal in frame.signals if signal.start_bit == 0)
        self.assertEqual((signal.unit, float(signal.factor)), ("boxes", 0.5))
        self.assertEqual({int(key): name for key, name in signal.values.items()}, {4: "two", 255: "all"})
        log = self.path("noted.log")
        with open(log, "w") as file:
            for byte in (4, 5):
                file.write(f"(1.0) can0 {frame.arbitration_id.id:03X}#{byte:02X}{'00' * (frame.size - 1)}\n")
        rows = berth("trace", log, "-m", machine).splitlines()
        for byte, row in zip((4, 5), [row for row in rows if "TPDO" in row]):
            theirs = frame.decode(bytes([byte] + [0] * (frame.size - 1)))[signal.name]
            self.assertIn(f"{float(theirs.phys_value):g} boxes", row)
            named = signal.values.get(byte)
            self.assertEqual(named is not None and f", {named})" in row, named is not None, row)


def numbers_of(row):
    return [str(int(value.split(" ")[0], 0)) for value in row["signals"].values()]


def dbc_name(slot):
    return slot.replace(" ", "_")


def pdo_id(can_id):
    sys.path.append("/usr/lib/python3/dist-packages")
    import canmatrix
    return canmatrix.ArbitrationId(int(can_id, 0))


if __name__ == "__main__":
    unittest.main()
