"""A CANopen slave of a few lines on a socketcand server, with no code of Berth's: it answers SDO (expedited), obeys NMT,
boots and beats as CiA 301 says, except where a test tells it to do otherwise.

    slave = RawSlave(test, port, "field", node=5, delay=0.25)
    slave = RawSlave(test, port, "field", node=6, beats=False)       # takes 1017h, and never sends a heartbeat
    slave = RawSlave(test, port, "field", node=7, silent={0x1000})   # no answer at all for this index
"""

import heapq
import itertools
import struct
import threading
import time

import bus

NO_OBJECT, NO_SUB, READ_ONLY, GENERAL = 0x06020000, 0x06090011, 0x06010002, 0x08000000
PRE_OPERATIONAL, OPERATIONAL, STOPPED = 0x7F, 0x05, 0x04
STATES = {0x01: OPERATIONAL, 0x02: STOPPED, 0x80: PRE_OPERATIONAL}
VENDOR, PRODUCT = 0x321, 9


def u16(value):
    return struct.pack("<H", value)


def u32(value):
    return struct.pack("<I", value)


def usual(serial):
    """The objects of a device as most are."""
    return {(0x1000, 0): u32(0x00020192), (0x1001, 0): b"\0", (0x1017, 0): u16(0), (0x1018, 0): b"\4",
            (0x1018, 1): u32(VENDOR), (0x1018, 2): u32(PRODUCT), (0x1018, 3): u32(0x10001), (0x1018, 4): u32(serial)}


class RawSlave(bus.Node):
    """`delay`: from a request to its answer, in seconds. `aborts`: index -> abort code of every access. `silent`: indices
    without an answer. `lacks`: (index, sub-index) or index that it does not have. `on_write`: called with the slave,
    (index, sub-index) and the bytes before the answer; True: there is no answer."""

    def __init__(self, test, port, name, node, delay=0.0, beats=True, aborts=None, silent=(), lacks=(), on_write=None,
                 more=None):
        self.node, self.delay, self.beats = node, delay, beats
        self.aborts, self.silent, self.on_write = aborts or {}, set(silent), on_write
        objects = {**usual(node), **(more or {})}
        self.new = {ref: value for ref, value in objects.items() if ref not in lacks and ref[0] not in lacks}
        self.objects = dict(self.new)
        self.state = 0
        self.restarts = 0
        self.due, self.order = [], itertools.count()
        self.wake = threading.Condition()
        self.ended = False
        super().__init__(test, port, name)
        self.worker = threading.Thread(target=self.work, daemon=True)
        self.worker.start()
        self.boot()

    # ---- what it sends, each at its time

    def later(self, seconds, what):
        with self.wake:
            heapq.heappush(self.due, (time.monotonic() + seconds, next(self.order), what))
            self.wake.notify()

    def work(self):
        while True:
            with self.wake:
                while not self.ended and (not self.due or self.due[0][0] > time.monotonic()):
                    self.wake.wait(max(0.0, self.due[0][0] - time.monotonic()) if self.due else None)
                if self.ended:
                    return
                what = heapq.heappop(self.due)[2]
            try:
                what()
            except OSError:
                return

    def boot(self):
        self.restarts += 1
        life = self.restarts
        self.state = 0
        self.objects = dict(self.new)

        def booted():
            if life != self.restarts:
                return
            self.state = PRE_OPERATIONAL
            self.send(0x700 + self.node, "00")
            self.later(0, lambda: self.beat(life))
        self.later(0.05, booted)

    def beat(self, life):
        if life != self.restarts:
            return
        period = struct.unpack("<H", self.objects.get((0x1017, 0), b"\0\0"))[0] / 1000
        if self.beats and period:
            self.send(0x700 + self.node, f"{self.state:02x}")
        self.later(period or 0.05, lambda: self.beat(life))

    # ---- what it hears

    def add(self, at, identifier, data):
        super().add(at, identifier, data)
        frame = self.frames[-1]
        if not frame.plain() or self.ended:
            return
        if frame.id == 0 and len(frame.data) == 2 and frame.data[1] in (0, self.node) and self.state:
            self.command(frame.data[0])
        elif frame.id == 0x600 + self.node and len(frame.data) == 8 and self.state in (PRE_OPERATIONAL, OPERATIONAL):
            answer = self.answer(frame.data)
            life = self.restarts
            if answer is not None:
                self.later(self.delay, lambda: life == self.restarts and self.send(0x580 + self.node, answer.hex()))

    def command(self, command):
        if command in (0x81, 0x82):
            self.boot()
        elif command in STATES:
            self.state = STATES[command]

    def answer(self, request):
        command, index, sub = struct.unpack_from("<BHB", request)
        ref = (index, sub)
        if command >> 5 == 4 or index in self.silent:
            return None
        if index in self.aborts:
            return self.abort(ref, self.aborts[index])
        if ref not in self.objects:
            known = any(each[0] == index for each in self.objects)
            return self.abort(ref, NO_SUB if known else NO_OBJECT)
        if command >> 5 == 2:
            value = self.objects[ref]
            return struct.pack("<BHB", 0x43 | (4 - len(value)) << 2, index, sub) + value.ljust(4, b"\0")
        if command >> 5 != 1 or not command & 2:
            return self.abort(ref, 0x05040001)
        size = 4 - (command >> 2 & 3) if command & 1 else len(self.objects[ref])
        if self.on_write is not None and self.on_write(self, ref, request[4:4 + size]):
            return None
        self.objects[ref] = bytes(request[4:4 + size])
        return struct.pack("<BHB", 0x60, index, sub) + bytes(4)

    @staticmethod
    def abort(ref, code):
        return struct.pack("<BHBI", 0x80, *ref, code)

    # ---- for tests

    def commands(self, command, since=0):
        """How many NMT commands of this kind it has heard."""
        return sum(1 for frame in list(self.frames[since:])
                   if frame.id == 0 and frame.data[:2] in (bytes([command, self.node]), bytes([command, 0])))

    def close(self):
        with self.wake:
            self.ended = True
            self.wake.notify()
        super().close()
