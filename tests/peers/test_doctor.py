"""`berth doctor` on a bus where only software that others wrote sends: heartbeats of Debian's python3-can.

What python-can 4.1.0 does wrong as a socketcand client (test_python_can.py) is not needed here: it only sends."""

import threading
import unittest

import plant_bus
import support
from support import berth_json

try:
    import can
except ImportError:
    can = None


class BesideAPeer(support.Case):
    def setUp(self):
        super().setUp()
        if can is None:
            support.absent("python3-can is not installed for /usr/bin/python3 (apt-get install python3-can)")
        self.port = plant_bus.serve(self, self.folder)
        line = can.Bus(interface="socketcand", channel="field", host="127.0.0.1", port=self.port)
        self.addCleanup(line.shutdown)
        over = threading.Event()
        beat = can.Message(arbitration_id=0x705, data=b"\x05", is_extended_id=False)

        def beats():
            while not over.wait(0.05):
                line.send(beat)

        thread = threading.Thread(target=beats)
        thread.start()
        self.addCleanup(thread.join)
        self.addCleanup(over.set)

    def test_the_bus_is_not_called_silent(self):
        for questions in ([], ["--active"], ["--intrusive"]):
            with self.subTest(questions=questions):
                told = berth_json("doctor", "--port", f"socketcand://127.0.0.1:{self.port}/field", "--for", "2 s",
                                  *questions, status=None)
                self.assertGreater(told["buses"][0]["frames"], 10, "it is deaf")
                self.assertNotIn("silent-bus", [finding["kind"] for finding in told["findings"]])


if __name__ == "__main__":
    unittest.main()
