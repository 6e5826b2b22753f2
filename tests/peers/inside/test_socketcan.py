"""can-utils and python-can on SocketCAN, with a Berth device on the same interface. Runs in the virtual machine, where the
interfaces vcan0 and vcan1 are (test_vm.py); emulated, so everything takes its time."""

import os
import shutil
import subprocess
import time
import unittest

import by_hand
import support
from matrix import SERVICES, tries

try:
    import can
except ImportError:
    can = None

PARTNER = os.path.join(os.path.dirname(support.BERTH), "berth_partner")
NODE = 5


class OnVcan(support.Case):
    def partner(self, port="socketcan:vcan0"):
        process = subprocess.Popen([PARTNER, port, "vcan0", str(NODE), "0xAB"], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, text=True)

        def stop():
            process.stdin.close()
            process.wait(support.PATIENCE)
            process.stdout.close()
        self.addCleanup(stop)
        self.assertEqual(process.stdout.readline().strip(), "ready")

    def dump(self, name="candump.log", interface="vcan0"):
        """candump, started and listening; gives a function that reads its lines so far."""
        support.need("candump")
        path = self.path(name)
        with open(path, "w") as out:
            process = subprocess.Popen(["candump", "-L", interface], stdout=out)

        def stop():
            process.terminate()
            process.wait()
        self.addCleanup(stop)

        def lines():
            with open(path) as file:
                return [line.split()[2] for line in file if line.endswith("\n")]
        support.until(lambda: self.cansend("7FF#", interface) or "7FF#" in lines(), "candump listens", step=0.2)
        return lines

    def cansend(self, frame, interface="vcan0"):
        subprocess.run(["cansend", interface, frame], check=True, timeout=support.PATIENCE)

    def sends(self, *frames):
        """By one program: here each start of one takes so long that a server would miss a segment."""
        log = self.write("frames.log", "".join(f"({i + 1}.000000) can0 {frame}\n" for i, frame in enumerate(frames)))
        subprocess.run(["canplayer", "-t", "-I", log, "vcan0=can0"], check=True, timeout=support.PATIENCE)

    def hears(self, lines, frame):
        try:
            support.until(lambda: frame in lines(), frame, step=0.1)
        except AssertionError as error:
            raise AssertionError(f"{error}; candump has {lines()[-40:]}") from None


class CanUtils(OnVcan):
    def test_cansend_asks_and_candump_hears(self):
        lines = self.dump()
        self.partner()
        self.hears(lines, "705#00")
        self.cansend("605#4018100400000000")
        self.hears(lines, "585#43181004AB000000")
        self.cansend("605#40FF2F0000000000")
        self.hears(lines, "585#80FF2F0000000206")
        self.cansend("605#2B171000C8000000")  # a heartbeat every 200 ms
        self.hears(lines, "585#6017100000000000")
        self.hears(lines, "705#7F")
        self.cansend("000#0105")
        self.hears(lines, "705#05")

    def test_canplayer_plays_a_master(self):
        log = self.write("master.log", "".join(
            f"({1 + i / 10:.6f}) can0 {frame}\n" for i, frame in enumerate(
                ["605#4018100100000000", "605#4018100200000000", "605#2B00200034120000", "605#4000200000000000", "000#8205"])))
        lines = self.dump()
        self.partner()
        self.hears(lines, "705#00")
        subprocess.run(["canplayer", "-I", log, "vcan0=can0"], check=True, timeout=support.PATIENCE)
        for frame in ("585#4318100123010000", "585#4318100207000000", "585#6000200000000000", "585#4B00200034120000"):
            self.hears(lines, frame)
        support.until(lambda: lines().count("705#00") == 2, "the second boot-up message")

    @tries("can-utils", *SERVICES)
    def test_every_service(self):
        lines = self.dump()
        self.partner()
        heard = 0

        def hears(frame):
            nonlocal heard
            try:
                heard = support.until(lambda: frame in lines()[heard:] and heard + lines()[heard:].index(frame) + 1, frame)
            except AssertionError as error:
                raise AssertionError(f"{error}; candump has {lines()[heard:]}") from None

        hears("705#00")
        by_hand.play(self.sends, hears)

    def test_slcanpty_carries_it_over_a_pseudo_terminal(self):
        support.need("slcanpty")
        lines = self.dump(interface="vcan1")
        said = self.path("slcanpty")
        with open(said, "w") as out:  # it keeps to itself what it prints to a pipe, but for stdbuf
            pty = subprocess.Popen(["stdbuf", "-oL", "slcanpty", "/dev/ptmx", "vcan1"], stdout=out, stderr=subprocess.STDOUT)

        def stop():
            pty.terminate()
            pty.wait()
        self.addCleanup(stop)

        def pseudo_terminal():
            with open(said) as file:
                return next((word for word in file.read().split() if word.startswith("/dev/pts/")), None)
        terminal = support.until(pseudo_terminal, "slcanpty names its pseudo-terminal")
        self.partner(f"slcan:{terminal}")
        self.hears(lines, "705#00")
        self.cansend("605#4018100400000000", "vcan1")
        self.hears(lines, "585#43181004AB000000")


class PythonCan(OnVcan):
    def setUp(self):
        super().setUp()
        if can is None:
            support.absent("python3-can is not installed for /usr/bin/python3 (apt-get install python3-can)")

    def test_sdo_and_nmt(self):
        line = can.Bus(interface="socketcan", channel="vcan0")
        self.addCleanup(line.shutdown)
        self.partner()

        def expect(identifier, data):
            end = time.monotonic() + support.PATIENCE
            while time.monotonic() < end:
                frame = line.recv(1.0)
                if frame is not None and frame.arbitration_id == identifier and bytes(frame.data) == bytes.fromhex(data):
                    return frame
            raise AssertionError(f"python-can did not hear {identifier:X} {data}")

        def say(identifier, data):
            line.send(can.Message(arbitration_id=identifier, data=bytes.fromhex(data), is_extended_id=False))

        self.assertFalse(expect(0x705, "00").is_extended_id)
        # At once after the boot-up message, and once: who says that it is there hears what it is asked.
        say(0x605, "4018100400000000")
        expect(0x585, "43181004AB000000")
        say(0x605, "2B171000C8000000")
        say(0x000, "0105")
        expect(0x705, "05")
        line.send(can.Message(arbitration_id=0x705, is_remote_frame=True, dlc=1, is_extended_id=False))
        say(0x000, "8105")
        expect(0x705, "00")


if __name__ == "__main__":
    unittest.main()
