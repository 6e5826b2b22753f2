"""The npm package `canopen` as master of Berth's devices: every service that it has, on a bus that `berth serve` offers.

Where the package is known to be wrong the test says so (NC in docs/hard-cases.md, and what was found here):
 - it takes answers within 30 ms (SDO) and 20 ms (LSS) unless told otherwise: it is told otherwise;
 - Fastscan goes on at the first answer to a question and does not wait for the others: only one device takes part here;
 - it has no block transfer's resending after a lost segment right: nothing is lost here;
 - setEmcyValid(true) sets bit 31 of 1014h, which means that EMCY is not valid: it is not called;
 - its RPDO event comes only with a value that changed: each value here is new;
 - an abort from the server it answers with an abort of its own: the server must bear it."""

import os
import shutil
import tempfile
import unittest

import bus
import npm_peer
import plant_bus
import support
import test_tshark
from matrix import SDO, tries
from npm_peer import PeerError

NODE = 5
MASTER = 127


class OnOneBus(support.Case):
    """One bus, one recorder, one npm process and one Berth device for all tests of a class."""

    @classmethod
    def setUpClass(cls):
        support.need("node", "npm")
        npm_peer.install()
        scope = plant_bus.ClassScope(cls)
        cls.shared = tempfile.mkdtemp(prefix="berth-peers-")
        cls.addClassCleanup(shutil.rmtree, cls.shared, ignore_errors=True)
        cls.port = plant_bus.serve(scope, cls.shared)
        cls.log = os.path.join(cls.shared, "bus.log")
        cls.node = bus.Node(scope, cls.port, "field", cls.log)
        cls.npm = npm_peer.Npm(scope, cls.port, "field")
        cls.begin(scope)

    def js(self, source):
        return self.npm.js(source)


class Master(OnOneBus):
    @classmethod
    def begin(cls, scope):
        cls.npm.js(f"""
            const eds = new canopen.Eds();
            eds.addSdoClientParameter({NODE}, 0x600 + {NODE}, 0x580 + {NODE});
            eds.addSdoServerParameter(0, 0x580 + {MASTER}, 0x600 + {MASTER});
            eds.addEmcyConsumer(0x80 + {NODE});
            eds.addHeartbeatConsumer({NODE}, 5000);
            eds.setEmcyCobId(0x80 + {MASTER});
            eds.setSyncCobId(0x80);
            eds.setSyncGenerationEnable(true);
            eds.setTimeCobId(0x100);
            eds.setTimeProducerEnable(true);
            eds.setTimeConsumerEnable(true);
            const came = eds.addEntry(0x2000, {{ parameterName: 'heard', dataType: canopen.DataType.UNSIGNED16 }});
            const back = eds.addEntry(0x2001, {{ parameterName: 'back', dataType: canopen.DataType.UNSIGNED32 }});
            my.said = eds.addEntry(0x2002, {{ parameterName: 'said', dataType: canopen.DataType.UNSIGNED32 }});
            eds.addReceivePdo({{ cobId: 0x180 + {NODE}, dataObjects: [came] }});
            eds.addReceivePdo({{ cobId: 0x280 + {NODE}, dataObjects: [back] }});
            eds.addTransmitPdo({{ cobId: 0x200 + {NODE}, transmissionType: 254, dataObjects: [my.said] }});
            my.m = await join('master', new canopen.Device({{ eds, id: {MASTER} }}));
            my.d = my.m.device;
            my.d.start();
            my.d.nmt.startNode();
            my.read = (index, subIndex, more) =>
                my.d.sdo.upload({{ deviceId: {NODE}, index, subIndex, timeout: 10000, ...more }});
            my.write = (index, subIndex, hex, more) => my.d.sdo.download(
                {{ deviceId: {NODE}, index, subIndex, data: Buffer.from(hex, 'hex'), timeout: 10000, ...more }});
        """)
        cls.partner = plant_bus.Partner(scope, cls.port, NODE)
        cls.node.wait_for(0x700 + NODE, "00", what="the device's boot-up message")

    def read(self, index, sub=0, block=False):
        return self.js(f"return my.read({index}, {sub}, {{ blockTransfer: {str(block).lower()} }})")

    def write(self, index, sub, data, block=False):
        self.js(f"return my.write({index}, {sub}, '{data}', {{ blockTransfer: {str(block).lower()}, blockInterval: 0 }})")

    def number(self, index, sub=0):
        return int.from_bytes(bytes.fromhex(self.read(index, sub)), "little")

    def refused(self, code, call, *arguments):
        with self.assertRaises(PeerError) as caught:
            call(*arguments)
        self.assertEqual(f"{caught.exception.code:08X}", code)

    def go(self, command, state):
        """An NMT command by the npm master; the device's next heartbeat must say so."""
        since = len(self.node.frames)
        self.js(f"my.d.nmt.{command}({NODE})")
        self.node.wait_for(0x700 + NODE, f"{state:02X}", since=since, what=f"a heartbeat after {command}")

    @tries("npm master", "SDO expedited upload", "SDO expedited download")
    def test_sdo_expedited(self):
        self.assertEqual([self.number(0x1018, sub) for sub in (1, 2, 3, 4)], [0x123, 7, 0x10000, 1])
        self.assertEqual(self.read(0x2014), "3412")
        self.write(0x2012, 0, "64")
        self.assertEqual(self.read(0x2012), "64")
        self.write(0x2001, 0, "78563412")
        self.assertEqual(self.number(0x2001), 0x12345678)

    def test_sdo_aborts(self):
        self.refused("06020000", self.read, 0x3000)
        self.refused("06090011", self.read, 0x1018, 9)
        self.refused("06010001", self.read, 0x2015)
        self.refused("06010002", self.write, 0x2014, 0, "0000")
        self.refused("06090031", self.write, 0x2012, 0, "65")
        self.refused("06090032", self.write, 0x2012, 0, "00")
        self.refused("06070012", self.write, 0x2012, 0, "01000000")
        self.refused("06070013", self.write, 0x2001, 0, "0100")
        self.assertEqual(self.number(0x1018, 1), 0x123)  # and the server goes on, after the package's answers to its aborts

    @tries("npm master", "SDO segmented upload", "SDO segmented download")
    def test_sdo_segmented(self):
        for length in (5, 7, 8, 14, 300):
            with self.subTest(length):
                text = "".join(chr(0x41 + i % 26) for i in range(length)).encode().hex()
                self.write(0x2010, 0, text)
                self.assertEqual(self.read(0x2010), text)
        self.write(0x2013, 0, "0102030405060708")
        self.assertEqual(self.read(0x2013), "0102030405060708")
        self.assertEqual(bytes.fromhex(self.read(0x1008)), b"Berth, the partner of other stacks")

    @tries("npm master", "SDO block upload", "SDO block download")
    def test_sdo_block(self):
        for length in (1, 6, 7, 8, 889, 890, 4000):  # 889: exactly one sub-block of 127 segments
            with self.subTest(length):
                data = bytes((i * 7 + i // 256) & 0xFF for i in range(length)).hex()
                self.write(0x2011, 0, data, block=True)
                self.assertEqual(self.read(0x2011, block=True), data)
        self.refused("06020000", self.read, 0x3000, 0, True)

    @tries("npm master", "NMT", "heartbeat")
    def test_nmt_and_heartbeats(self):
        self.write(0x1017, 0, "6400")  # 100 ms
        self.go("startNode", 5)
        self.npm.wait_for("heartbeat", node=NODE, state=5)
        self.go("stopNode", 4)
        self.npm.wait_for("heartbeat", node=NODE, state=4)
        self.go("enterPreOperational", 127)
        self.npm.wait_for("heartbeat", node=NODE, state=127)
        for command in ("resetNode", "resetCommunication"):  # 1017h is 0 again after either
            since = len(self.node.frames)
            self.js(f"my.d.nmt.{command}({NODE})")
            self.node.wait_for(0x700 + NODE, "00", since=since, what=f"the boot-up message after {command}")
            self.assertEqual(self.number(0x1017), 0)

    @tries("npm master", "EMCY")
    def test_emergencies_of_the_device(self):
        self.write(0x2030, 0, "2031")
        heard = self.npm.wait_for("emergency", cobId=0x80 + NODE, code=0x3120)
        self.assertEqual((heard["register"], heard["info"]), (0x05, "0102030405"))
        self.write(0x2031, 0, "2031")
        heard = self.npm.wait_for("emergency", cobId=0x80 + NODE, code=0)
        self.assertEqual(heard["register"], 0)
        self.assertEqual(self.number(0x1003, 1) & 0xFFFF, 0x3120)

    @tries("npm master", "EMCY")
    def test_emergencies_of_the_master(self):
        self.write(0x1028, MASTER, f"{0x80 + MASTER:02X}000000")
        self.js("my.d.emcy.write(0x5530, Buffer.from([9, 8, 7]))")
        support.until(lambda: self.number(0x2050) == 0x5530, "the device hears the npm master's emergency")
        self.assertEqual(self.number(0x2051), MASTER)
        self.write(0x1028, MASTER, "00000080")

    @tries("npm master", "heartbeat")
    def test_heartbeat_of_the_master_is_supervised(self):
        self.write(0x1016, 1, f"E803{MASTER:02X}00")  # 1000 ms
        self.js("my.d.eds.setHeartbeatProducerTime(200)")
        support.until(lambda: self.number(0x2060) == 5, "the device hears that the npm master is operational")
        self.js("my.d.eds.setHeartbeatProducerTime(0)")
        self.npm.wait_for("emergency", cobId=0x80 + NODE, code=0x8130)
        self.js("my.d.eds.setHeartbeatProducerTime(200)")
        support.until(lambda: self.number(0x2061) == 3, "the device hears the npm master again")
        self.write(0x1016, 1, "00000000")
        self.js("my.d.eds.setHeartbeatProducerTime(0)")

    @tries("npm master", "PDO")
    def test_pdo(self):
        self.write(0x1017, 0, "6400")
        self.go("startNode", 5)
        self.write(0x2000, 0, "3412")
        self.assertEqual(self.npm.wait_for("pdo", cobId=0x180 + NODE, values=[0x1234])["values"], [0x1234])
        self.js("my.said.value = 0xCAFE0001")
        support.until(lambda: self.number(0x2001) == 0xCAFE0001, "the device takes the npm master's PDO")
        self.js("my.d.sync.write()")  # TPDO 2 is of type 1: sent after each SYNC
        self.npm.wait_for("pdo", cobId=0x280 + NODE, values=[0xCAFE0001])
        # Shorter than the mapping: not processed, EMCY 8210h, whose information holds what came.
        self.js(f"my.m.send(0x200 + {NODE}, 'ABCD')")
        self.npm.wait_for("emergency", cobId=0x80 + NODE, code=0x8210)
        self.assertEqual(self.number(0x2001), 0xCAFE0001)
        self.js("my.said.value = 0xCAFE0002")
        support.until(lambda: self.number(0x2001) == 0xCAFE0002, "the device takes the next one")
        self.go("enterPreOperational", 127)
        self.write(0x1017, 0, "0000")

    @tries("npm master", "SYNC")
    def test_sync(self):
        before = self.number(0x2040)
        self.js("my.d.sync.write()")
        support.until(lambda: self.number(0x2040) == before + 1, "the device hears one SYNC")
        self.write(0x1019, 0, "04")  # a counter from 1 to 4
        self.js("my.d.sync.write(3)")
        support.until(lambda: self.number(0x2041) == 3, "the device hears the SYNC's counter")
        self.js("my.d.sync.write()")  # without a counter it counts for nothing: EMCY 8240h
        self.npm.wait_for("emergency", cobId=0x80 + NODE, code=0x8240)
        self.write(0x1006, 0, "50C30000")  # 50 ms
        self.write(0x1005, 0, "80000040")
        for counter in (1, 2, 3, 4):
            self.npm.wait_for("sync", counter=counter)
        self.write(0x1005, 0, "80000000")
        self.write(0x1006, 0, "00000000")
        self.write(0x1019, 0, "00")
        self.assertEqual(self.npm.heard("sync", counter=5), [])

    def test_time(self):
        moment = 1_700_000_000_123  # 2023-11-14 22:13:20.123 UTC: day 14562 since 1984-01-01, 80,000,123 ms after midnight
        self.js(f"my.d.time.write(new Date({moment}))")
        support.until(lambda: self.number(0x2021) == 14562, "the device hears TIME")
        self.assertEqual(self.number(0x2020), 80_000_123)
        self.write(0x2020, 0, "01000000")
        self.write(0x2021, 0, "0100")
        self.write(0x2022, 0, "01")  # sends 1984-01-02 00:00:00.001
        self.npm.wait_for("time", ms=441_763_200_000 + 86_400_000 + 1)

    @tries("tshark", *SDO, "NMT", "heartbeat", "EMCY", "SYNC", "PDO")
    def test_zz_what_was_on_the_bus_is_decoded_by_tshark(self):
        """Last of its class: everything that the tests before it put on the bus."""
        support.need("tshark")
        judge = test_tshark.Judge()
        log = shutil.copy(self.log, self.path("bus.log"))  # the device's heartbeats may go on
        kinds = judge.judge(log)
        judge.seen(kinds, "NMT", "SYNC", "TIME", "EMCY", "PDO", "boot-up", "SDO abort", "SDO upload segment",
                   "SDO download segment", "SDO block download initiate", "SDO block download acknowledge",
                   "SDO block download end", "SDO block upload initiate", "SDO block upload start",
                   "SDO block upload acknowledge", "SDO block upload end", "SDO block segment")


class LssMaster(OnOneBus):
    ONE = "0x123, 7, 0x10000, 0x0A"

    @classmethod
    def begin(cls, scope):
        cls.npm.js("""
            my.m = await join('master', new canopen.Device({ eds: new canopen.Eds(), id: 127, enableLss: true }));
            my.lss = my.m.device.lss;
            my.m.device.start();
        """)
        cls.partner = plant_bus.Partner(scope, cls.port, 255, 0x0A)

    @tries("npm master", "LSS")
    def test_fastscan_and_a_node_id(self):
        # 300 ms a question: the package takes silence for a set bit. Null: nobody, the device is not up yet.
        found = support.until(lambda: self.js("return await my.lss.fastscan({ timeout: 300 })"), "Fastscan finds somebody")
        self.assertEqual(found, {"vendorId": 0x123, "productCode": 7, "revisionNumber": 0x10000, "serialNumber": 0x0A})
        inquired = self.js("""return [await my.lss.inquireVendorId(10000), await my.lss.inquireProductCode(10000),
                                      await my.lss.inquireRevisionNumber(10000), await my.lss.inquireSerialNumber(10000)]""")
        self.assertEqual(inquired, [0x123, 7, 0x10000, 0x0A])
        with self.assertRaises(PeerError) as caught:
            self.js("await my.lss.configureNodeId(200, 10000)")
        self.assertEqual(caught.exception.code, 1)
        self.js("await my.lss.configureNodeId(6, 10000)")
        with self.assertRaises(PeerError) as caught:
            self.js("await my.lss.configureBitTiming(0, 5, 10000)")  # table 0, index 5 is reserved
        self.assertEqual(caught.exception.code, 1)
        self.js("await my.lss.storeConfiguration(10000)")
        since = len(self.node.frames)
        self.js("my.lss.switchModeGlobal(0)")
        self.node.wait_for(0x706, "00", since=since, what="the boot-up message with the new node-ID")
        # It has a node-ID now: Fastscan is not for it any more, selecting by address is.
        self.assertIsNone(self.js("return await my.lss.fastscan({ timeout: 500 })"))
        self.js(f"await my.lss.switchModeSelective({self.ONE}, 10000)")
        self.assertEqual(self.js("return await my.lss.inquireSerialNumber(10000)"), 0x0A)
        self.js("my.lss.switchModeGlobal(0)")
        with self.assertRaises(PeerError):
            self.js("await my.lss.switchModeSelective(0x123, 7, 0x10000, 0x0B, 500)")


if __name__ == "__main__":
    unittest.main()
