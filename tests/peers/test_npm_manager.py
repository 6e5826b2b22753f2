"""The npm package `canopen` reads Berth's own master while `berth up` runs, as a stranger would: the manager objects of
CiA 302, statuses, and the command buffer 1023h (docs/manager-objects.md)."""

import json

import plant_bus
import support
from matrix import tries
from npm_peer import PeerError
from support import BERTH
from test_npm_device import UnderBerth
from test_npm_master import OnOneBus

MANAGER, DEVICE, STRANGER = 126, 20, 99
MACHINE = """
[machine]
name = "manager {port}"

[bus.field]
port      = "socketcand://127.0.0.1:{port}/field"
bitrate   = 500_000
master_id = {manager}
commands  = {{ verbs = ["report", "sdo read", "sdo write", "nmt", "configure", "upload"] }}

[[slot]]
bus    = "field"
id     = {device}
name   = "partner"
type   = {{ vendor = 0x123, product = 7 }}
assign = "fixed"
"""

# A DCF for the partner, whose object 2012h shall be 55.
DCF = """[FileInfo]
FileName=partner.dcf
FileVersion=1
FileRevision=0
EDSVersion=4.0
Description=What a configuration tool writes
CreationTime=09:00AM
CreationDate=01-15-2026
CreatedBy=tests/peers

[DeviceInfo]
VendorName=Berth
VendorNumber=0x123
ProductName=Partner
ProductNumber=0x7
RevisionNumber=0x10000
BaudRate_500=1
Granularity=8

[MandatoryObjects]
SupportedObjects=3
1=0x1000
2=0x1001
3=0x1018

[ManufacturerObjects]
SupportedObjects=1
1=0x2012

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
PDOMapping=0

[1001]
ParameterName=Error register
ObjectType=0x7
DataType=0x0005
AccessType=ro
PDOMapping=0

[1018]
ParameterName=Identity object
ObjectType=0x9
SubNumber=2

[1018sub0]
ParameterName=Highest sub-index supported
ObjectType=0x7
DataType=0x0005
AccessType=const
DefaultValue=1
PDOMapping=0

[1018sub1]
ParameterName=Vendor-ID
ObjectType=0x7
DataType=0x0007
AccessType=ro
PDOMapping=0

[2012]
ParameterName=At most 100
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=1
ParameterValue=55
PDOMapping=0
"""


def concise(*entries):
    """The stream of CiA 302-3, in hex: (index, sub-index, bytes)."""
    stream = len(entries).to_bytes(4, "little")
    for index, sub, data in entries:
        stream += index.to_bytes(2, "little") + bytes([sub]) + len(data).to_bytes(4, "little") + data
    return stream.hex()


class OfTheManager(OnOneBus):
    @classmethod
    def begin(cls, scope):
        if not UnderBerth.has_ports():
            support.absent("this Berth's commands have no real ports")
        machine = f"{cls.shared}/machine.toml"
        with open(machine, "w") as file:
            file.write(MACHINE.format(port=cls.port, manager=MANAGER, device=DEVICE))
        cls.partner = plant_bus.Partner(scope, cls.port, DEVICE)
        cls.up = support.Running(scope, BERTH, "up", machine, "--yes", "--pace", "--store", f"{cls.shared}/store.db")
        cls.npm.js(f"""
            const eds = new canopen.Eds();
            eds.addSdoClientParameter({MANAGER}, 0x600 + {MANAGER}, 0x580 + {MANAGER});
            my.m = await join('stranger', new canopen.Device({{ eds, id: {STRANGER} }}));
            my.d = my.m.device;
            my.d.start();
            my.read = (index, subIndex) =>
                my.d.sdo.upload({{ deviceId: {MANAGER}, index, subIndex, timeout: 10000 }});
            my.write = (index, subIndex, hex, more = {{}}) => my.d.sdo.download(
                {{ deviceId: {MANAGER}, index, subIndex, data: Buffer.from(hex, 'hex'), timeout: 10000, ...more }});
        """)
        cls.node.wait_for(0x700 + DEVICE, "05", what="the device is operational")
        cls.node.wait_for(0x700 + MANAGER, "05", what="the manager is operational")

    def number(self, index, sub=0):
        return int.from_bytes(bytes.fromhex(self.js(f"return my.read({index}, {sub})")), "little")

    def write(self, index, sub, data, block=False):
        more = "{ blockTransfer: true, blockInterval: 0 }" if block else "{}"
        self.js(f"return my.write({index}, {sub}, '{data}', {more})")

    def command(self, line):
        """One command by 1023h; gives its status and its confirmation."""
        self.write(0x1023, 1, line.encode().hex())
        support.until(lambda: self.number(0x1023, 2) != 0xFF, "the command's confirmation")
        return self.number(0x1023, 2), json.loads(bytes.fromhex(self.js("return my.read(0x1023, 3)")))

    @tries("npm master", "SDO expedited upload", "SDO expedited download")
    def test_the_slot_table(self):
        support.until(lambda: self.number(0x5F00, 7) == 1, "all operational")
        self.assertEqual(self.number(0x1F80) & 1, 1)
        self.assertEqual(self.number(0x1F81, DEVICE), 0b10101)
        self.assertEqual(self.number(0x1F81, DEVICE + 1), 0)
        self.assertEqual(self.number(0x1F82, DEVICE), 5)
        self.assertEqual([self.number(index, DEVICE) for index in (0x1F85, 0x1F86, 0x1F88)], [0x123, 7, 1])
        self.assertEqual([self.number(0x5F00, sub) for sub in (2, 3)], [1, 1])
        self.assertEqual(self.number(0x5F01, 1), 500_000)
        with self.assertRaises(PeerError) as caught:
            self.write(0x1F81, DEVICE, "00000000")
        self.assertEqual(caught.exception.code, 0x06010002)

    @tries("npm master", "SDO expedited download", "NMT")
    def test_request_nmt(self):
        for state, told in ((4, "04"), (5, "05")):
            since = len(self.node.frames)
            self.write(0x1F82, DEVICE, f"{state:02x}")
            self.node.wait_for(0x700 + DEVICE, told, since=since, what=f"the device after request NMT {state}")

    @tries("npm master", "SDO segmented upload", "SDO segmented download")
    def test_commands(self):
        line = json.dumps({"verb": "sdo read", "arguments": {"node": str(DEVICE), "object": "1018h:01", "type": "u32"}})
        status, reply = self.command(line)
        self.assertEqual(status, 1, reply)
        self.assertIn("291", json.dumps(reply))  # 0x123
        status, reply = self.command('{"verb": "no such"}')
        self.assertEqual(status, 3)
        self.assertIn("no such", reply["error"]["message"])

    def limit(self):
        """2012h of the device."""
        status, reply = self.command(json.dumps(
            {"verb": "sdo read", "arguments": {"node": str(DEVICE), "object": "2012h", "type": "u8"}}))
        self.assertEqual(status, 1, reply)
        return reply["value"]

    def boot(self):
        since = len(self.node.frames)
        self.write(0x1F82, DEVICE, "06")
        self.node.wait_for(0x700 + DEVICE, "05", since=since, what="the device after its reset")

    @tries("npm master", "SDO block download", "SDO segmented download", "SDO segmented upload")
    def test_configurations(self):
        """As a configuration tool: a DCF to 1F20h, then a concise DCF to 1F22h; each is in the device behind its boot-up."""
        self.write(0x1F20, DEVICE, DCF.encode().hex(), block=True)
        self.assertEqual(bytes.fromhex(self.js(f"return my.read(0x1F20, {DEVICE})")).decode(), DCF)
        self.assertEqual(self.number(0x5F04, DEVICE), 1, "not yet")
        self.boot()
        self.assertEqual(self.limit(), 55)
        self.assertEqual(self.number(0x5F04, DEVICE), 3)
        self.write(0x1F22, DEVICE, concise((0x2012, 0, b"\x42")))
        self.boot()
        self.assertEqual(self.limit(), 0x42)
        with self.assertRaises(PeerError) as caught:
            self.write(0x1F20, DEVICE, DCF.replace("0x123", "0x124").encode().hex(), block=True)
        self.assertEqual(caught.exception.code, 0x06040043)
        with self.assertRaises(PeerError) as caught:
            self.write(0x1F22, DEVICE, "0500000012")
        self.assertEqual(caught.exception.code, 0x06090030)
        self.assertEqual(self.number(0x5F04, DEVICE), 3, "nothing has changed")
