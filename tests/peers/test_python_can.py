"""Debian's python3-can on a bus that `berth serve` offers by socketcand.

python-can 4.1.0's socketcand client is known to be wrong in three ways, which these tests keep clear of: an element that
TCP cut in two loses its first byte and with it the frame (so frames come one by one here); every frame it receives is
called an extended one; and an identifier goes out with as few digits as it has, so that an extended one below 10000000h
would leave as another one."""

import shutil
import tempfile
import time
import unittest

import bus
import by_hand
import plant_bus
import support
from matrix import SERVICES, tries

try:
    import can
except ImportError:
    can = None

PLANT = """
[plant]
seed = 1

[bus.field]
bitrate = 500_000

[[device]]
bus       = "field"
name      = "one"
type      = { vendor = 0x123, product = 7, revision = 0x10000 }
serial    = 0xAB
node_id   = 2
heartbeat = "200 ms"
speaks    = ["lss", "fastscan", "rand"]
"""


class Socketcand(support.Case):
    @classmethod
    def setUpClass(cls):
        if can is None:
            support.absent("python3-can is not installed for /usr/bin/python3 (apt-get install python3-can)")
        shared = tempfile.mkdtemp(prefix="berth-peers-")
        cls.addClassCleanup(shutil.rmtree, shared, ignore_errors=True)
        cls.port = plant_bus.serve(plant_bus.ClassScope(cls), shared, PLANT)

    def open(self):
        opened = can.Bus(interface="socketcand", channel="field", host="127.0.0.1", port=self.port)
        self.addCleanup(opened.shutdown)
        return opened

    def expect(self, line, identifier, data=None, what=""):
        """Passes over other frames."""
        end = time.monotonic() + support.PATIENCE
        while time.monotonic() < end:
            frame = line.recv(1.0)
            if frame is not None and frame.arbitration_id == identifier and \
                    (data is None or bytes(frame.data) == bytes.fromhex(data)):
                return frame
        raise AssertionError(f"python-can did not hear {identifier:X} {data or ''}: {what}")

    def say(self, line, identifier, data):
        line.send(can.Message(arbitration_id=identifier, data=bytes.fromhex(data), is_extended_id=identifier > 0x7FF))

    def test_a_device_is_heard_and_commanded(self):
        line = self.open()
        self.expect(line, 0x702, "7F", "the device's heartbeat")
        self.say(line, 0x000, "0102")
        self.expect(line, 0x702, "05", "operational")
        self.say(line, 0x602, "4018100400000000")
        self.expect(line, 0x582, "43181004AB000000", "1018h:04")
        self.say(line, 0x602, "40FF2F0000000000")
        self.expect(line, 0x582, "80FF2F0000000206", "no such object")
        self.say(line, 0x000, "8002")
        self.expect(line, 0x702, "7F", "pre-operational")
        self.say(line, 0x000, "8102")
        self.expect(line, 0x702, "00", "boot-up after reset node")

    @tries("python-can", "LSS")
    def test_lss_by_hand(self):
        line = self.open()
        for command, value in ((0x40, 0x123), (0x41, 7), (0x42, 0x10000), (0x43, 0xAB)):
            self.say(line, 0x7E5, f"{command:02X}{value.to_bytes(4, 'little').hex()}000000")
        self.expect(line, 0x7E4, "4400000000000000", "selected")
        self.say(line, 0x7E5, "5E00000000000000")
        self.expect(line, 0x7E4, "5E02000000000000", "its node-ID")
        self.say(line, 0x7E5, "0400000000000000")

    def test_clients_hear_each_other_and_not_themselves(self):
        one, other = self.open(), self.open()
        ours = bus.Node(self, self.port, "field")
        self.say(one, 0x321, "0102030405060708")
        self.expect(other, 0x321, "0102030405060708")
        ours.wait_for(0x321, "0102030405060708")
        self.say(other, 0x322, "")
        self.expect(one, 0x322, "")
        end = time.monotonic() + 0.5
        while time.monotonic() < end:
            heard = one.recv(0.1)
            self.assertFalse(heard is not None and heard.arbitration_id == 0x321, "its own frame came back")
        self.assertEqual([frame.id for frame in ours.frames if frame.id in (0x321, 0x322)], [0x321, 0x322])

    def test_rand_in_extended_frames(self):
        line = self.open()
        ours = bus.Node(self, self.port, "field")
        self.say(line, 0x1F940000, "80000000")
        frame = ours.wait_for(0x1F940000, "80000000")
        self.assertTrue(frame.extended)

    def test_a_client_that_goes_takes_nothing_with_it(self):
        for _ in range(5):
            can.Bus(interface="socketcand", channel="field", host="127.0.0.1", port=self.port).shutdown()
        self.expect(self.open(), 0x702, what="the device's heartbeat")


class Services(support.Case):
    """Every service by hand, from python-can to Berth's own device."""

    @tries("python-can", *SERVICES)
    def test_every_service(self):
        if can is None:
            support.absent("python3-can is not installed for /usr/bin/python3 (apt-get install python3-can)")
        port = plant_bus.serve(self, self.folder)
        line = can.Bus(interface="socketcand", channel="field", host="127.0.0.1", port=port)
        self.addCleanup(line.shutdown)
        plant_bus.Partner(self, port, 5, 0xAB)

        def sends(*texts):
            for text in texts:
                identifier, _, data = text.partition("#")
                line.send(can.Message(arbitration_id=int(identifier, 16), data=bytes.fromhex(data), is_extended_id=False))

        def hears(text):
            end, passed = time.monotonic() + support.PATIENCE, []
            while time.monotonic() < end:
                frame = line.recv(1.0)
                if frame is not None:
                    passed.append(f"{frame.arbitration_id:03X}#{bytes(frame.data).hex().upper()}")
                    if passed[-1] == text:
                        return
            raise AssertionError(f"python-can did not hear {text}, but {passed[-20:]}")

        hears("705#00")
        by_hand.play(sends, hears)


if __name__ == "__main__":
    unittest.main()
