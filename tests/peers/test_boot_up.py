"""Slaves that misbehave while they boot (CiA 302-2, paper 5 Figure 4), on raw sockets with no code of Berth's, under
`berth up`: what the slot says, and which letter.

Times are the slaves' own; a test waits for what it expects, and counts a neighbour's heartbeats where nothing more may
come."""

import json
import struct
import subprocess
import unittest

import plant_bus
import support
from raw_slave import GENERAL, OPERATIONAL, PRODUCT, RawSlave, VENDOR, u16, u32

HEAD = """
[machine]
name = "boot up {port}"

[bus.field]
port      = "socketcand://127.0.0.1:{port}/field"
bitrate   = 500_000
master_id = 126

[timing]
listen = "0 s"
heartbeat_period = "200 ms"
"""
SLOT = """
[[slot]]
bus    = "field"
id     = {id}
name   = "s{id}"
assign = "fixed"
type   = {{ vendor = {vendor}, product = {product} }}
{more}
"""
DCF = """[DeviceInfo]
VendorNumber=0x321
ProductNumber=9
[DeviceComissioning]
NodeID={id}
[MandatoryObjects]
SupportedObjects=3
1=0x1000
2=0x1001
3=0x1018
[1000]
ParameterName=Device type
ObjectType=7
DataType=7
AccessType=ro
[1001]
ParameterName=Error register
ObjectType=7
DataType=5
AccessType=ro
[1018]
ParameterName=Identity
ObjectType=9
SubNumber=2
[1018sub0]
ParameterName=n
ObjectType=7
DataType=5
AccessType=ro
[1018sub1]
ParameterName=Vendor-ID
ObjectType=7
DataType=7
AccessType=ro
[ManufacturerObjects]
SupportedObjects=1
1=0x2000
[2000]
ParameterName=Limit
ObjectType=7
DataType=6
AccessType=rw
DefaultValue=1
ParameterValue=9
"""
LIMIT = (0x2000, 0)
NEIGHBOUR = 1  # a slave that does all as it should


class BootUp(support.Case):
    def setUp(self):
        super().setUp()
        self.port = plant_bus.serve(self, self.folder)

    def slave(self, node, **more):
        return RawSlave(self, self.port, "field", node, **more)

    def up(self, *slots, neighbour=True):
        """`slots`: node-IDs, or (node-ID, more keys of its slot)."""
        if neighbour:
            self.neighbour = self.slave(NEIGHBOUR)
            slots = (NEIGHBOUR, *slots)
        text = HEAD.format(port=self.port)
        for slot in slots:
            node, more = slot if isinstance(slot, tuple) else (slot, "")
            text += SLOT.format(id=node, vendor=VENDOR, product=PRODUCT, more=more)
        self.machine = self.write("machine.toml", text)
        self.berth = support.Running(self, support.BERTH, "up", self.machine, "--yes", "--pace", "--json", "--events",
                                     "--store", self.path("store.db"))

    def config(self, node):
        return f'config = "{self.write(f"s{node}.dcf", DCF.format(id=node)).rsplit("/", 1)[1]}"'

    def slot(self, node):
        """As `berth status` has it; {} while nobody answers."""
        done = subprocess.run([support.BERTH, "status", self.machine, "--store", self.path("store.db"), "--json"],
                              capture_output=True, text=True, timeout=support.PATIENCE)
        try:
            slots = json.loads(done.stdout)["slots"]
        except (ValueError, KeyError):
            return {}
        return next((slot for slot in slots if slot["id"] == node), {})

    def until(self, node, state, boot=None, words=()):
        def look():
            slot = self.slot(node)
            fits = slot.get("state") == state and (boot is None or slot.get("boot") == boot)
            return slot if fits and all(word in slot.get("reason", "") for word in words) else None
        try:
            return support.until(look, f"slot {node} is {state} {boot or ''} {words}", step=0.2)
        except AssertionError as error:
            self.fail(f"{error}: {self.slot(node)}\n{self.berth.output()[-4000:]}")

    def for_beats(self, count, each=lambda: None):
        """Until the neighbour has sent so many heartbeats more."""
        sent = len([f for f in self.neighbour.frames if f.id == 0x700 + NEIGHBOUR])

        def done():
            each()
            return len([f for f in list(self.neighbour.frames) if f.id == 0x700 + NEIGHBOUR]) >= sent + count
        support.until(done, f"{count} heartbeats of the neighbour", step=0.2)

    def told(self, node):
        """Its states, as `berth up` told them one after the other."""
        told = []
        for line in self.berth.output().splitlines():
            try:
                event = json.loads(line)
            except ValueError:
                continue
            if event.get("kind") == "state" and event.get("slot") == f"s{node}":
                told.append(event["text"])
        return told

    # ---- part 3: one patience

    def test_a_slow_answer_is_an_answer(self):
        delays = {10: 0.05, 11: 0.1, 12: 0.25, 13: 0.45, 14: 0.9}
        for node, delay in delays.items():
            self.slave(node, delay=delay)
        self.up(*delays, *range(20, 50))  # thirty slots that stay empty
        for node in delays:
            self.until(node, "operational")

    # ---- part 4: by the letter

    def test_a_heartbeat_that_never_starts_is_letter_k(self):
        slave = self.slave(5, beats=False)
        self.up(5)
        self.until(5, "failed", "K", ("heartbeat",))
        at = len(self.told(5))
        self.for_beats(50, lambda: self.assertEqual(self.slot(5)["state"], "failed"))
        self.assertEqual(self.told(5)[at:], [], "it stays that")
        self.assertEqual(slave.commands(0x01), 1, "it is started once")
        self.assertFalse([text for text in self.told(5) if text.startswith("operational")], self.told(5))
        slave.beats = True
        self.until(5, "operational")
        self.assertNotIn("boot", self.slot(5))

    def test_it_is_watched_all_the_same(self):
        slave = self.slave(5, beats=False)
        self.up(5)
        self.until(5, "failed", "K")
        slave.close()
        self.until(5, "absent", "B")

    def test_without_1017h_it_has_a_letter_and_a_reason(self):
        self.slave(5, lacks={0x1017})
        self.up(5)
        slot = self.until(5, "operational", "K", ("1017h", "SDO"))
        self.assertIn("06020000", slot["reason"])

    def test_an_abort_at_1020h_means_download(self):
        codes = {5: 0x06020000, 6: GENERAL, 7: 0x06090011, 8: 0x06010001}
        slaves = {node: self.slave(node, aborts={0x1020: code}, more={LIMIT: u16(1)}) for node, code in codes.items()}
        self.up(*((node, self.config(node)) for node in codes))
        for node, slave in slaves.items():
            self.until(node, "operational")
            self.assertEqual(slave.objects[LIMIT], u16(9))

    def test_without_1000h_it_is_letter_b(self):
        self.slave(5, silent={0x1000})
        self.up(5)
        self.until(5, "absent", "B", ("1000h",))

    def test_the_mismatch_of_a_device_leaves_with_it(self):
        other = self.slave(5, more={(0x1018, 2): u32(77)})
        self.up(5)
        self.until(5, "wrong type", "M")
        other.close()
        support.until(lambda: self.slot(5).get("state") in ("empty", "absent"), "the slot's state is its own again")
        self.assertNotEqual(self.slot(5).get("boot"), "M")
        self.assertNotIn("0000004D", self.slot(5).get("reason", "").upper())
        self.slave(5)
        self.until(5, "operational")
        self.assertNotIn("boot", self.slot(5))

    def test_a_restart_in_the_configuration_keeps_its_cause(self):
        def restart(slave, ref, data):
            if ref != LIMIT:
                return False
            slave.boot()
            return True
        slave = self.slave(5, more={LIMIT: u16(1)}, on_write=restart)
        self.up((5, self.config(5)))
        self.until(5, "failed", "J", ("restart", "in a row"))  # it is tried three times before that
        booted = slave.restarts
        self.for_beats(50, lambda: self.assertIn("restart", self.slot(5).get("reason", "")))
        self.assertEqual(self.slot(5)["state"], "failed")
        self.assertEqual(slave.restarts, booted, "it is not configured again and again")
        slave.on_write = None
        slave.boot()  # a person switches it off and on
        self.until(5, "operational")

    def test_a_part_that_it_does_not_provide_is_not_held_against_it(self):
        parts = {5: {(0x1018, 4)}, 6: {(0x1018, 3), (0x1018, 4)}, 7: {(0x1018, 2), (0x1018, 3), (0x1018, 4)}}
        for node, lacks in parts.items():
            self.slave(node, lacks=lacks)
        self.up(*parts)
        for node in parts:
            self.until(node, "operational")


if __name__ == "__main__":
    unittest.main()
