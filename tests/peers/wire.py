"""What a CANopen frame says, read from its bytes alone: CiA 301 and CiA 305, by hand, with no code of Berth's.

Names and numbers are those of Wireshark's fields (`canopen.sdo.ccs` and so on, without `canopen.`), so that a reading can be
compared with tshark's field by field. Only the predefined connection set is read; 29-bit and remote frames say nothing here."""

import struct


class Frame:
    """One line of a candump log."""

    def __init__(self, line):
        self.line = line.strip()
        time, self.bus, text = self.line.split()[:3]
        self.time = float(time[1:-1])
        identifier, _, data = text.partition("#")
        self.fd = data.startswith("#")
        self.extended = len(identifier) > 3
        self.id = int(identifier, 16)
        self.error = self.extended and bool(self.id & 0x20000000)
        self.remote = data[:1] == "R"
        self.data = b"" if self.remote else bytes.fromhex(data[2:] if self.fd else data)

    def plain(self):
        return not (self.extended or self.remote or self.fd)


def read_log(path):
    with open(path) as file:
        return [Frame(line) for line in file if line.strip()]


def u16(data, at):
    return struct.unpack_from("<H", data, at)[0]


def u32(data, at):
    return struct.unpack_from("<I", data, at)[0]


class Reader:
    """Reads frames in their order: within a block transfer what a frame means depends on those before it."""

    def __init__(self):
        self.blocks = {}  # (bus, node) -> [direction that sends segments, block size] while a sub-block runs

    def read(self, frame):
        """(kind, fields), the kind a word such as "SDO download block"; ("", {}) for what is not CANopen's."""
        if not frame.plain():
            return "", {}
        code, node, data = frame.id >> 7, frame.id & 0x7F, frame.data
        if frame.id == 0:
            return ("NMT", {"nmt_ctrl.cd": data[0], "nmt_ctrl.node_id": data[1]}) if len(data) == 2 else ("", {})
        if frame.id == 0x80:
            return "SYNC", ({"sync.counter": data[0]} if data else {})
        if code == 1:
            return "EMCY", {"em.err_code": u16(data, 0), "em.err_reg": data[2], "em.err_field": data[3:8].hex()}
        if frame.id == 0x100:
            return "TIME", {"time_stamp_ms": u32(data, 0) & 0x0FFFFFFF, "time_stamp_days": u16(data, 4)}
        if 3 <= code <= 10 and node:
            return "PDO", ({"pdo.data.bytes": data.hex()} if data else {})
        if code in (11, 12) and node and len(data) == 8:
            return self.sdo(frame, (frame.bus, node), code == 12)
        if code == 14 and node:
            return ("boot-up" if data[0] == 0 else "error control"), \
                {"nmt_guard.toggle": data[0] >> 7, "nmt_guard.state": data[0] & 0x7F}
        if frame.id in (0x7E4, 0x7E5) and len(data) == 8:
            return lss(data, frame.id == 0x7E5)
        return "", {}

    def sdo(self, frame, channel, client):
        data, command = frame.data, frame.data[0]
        side = "ccs" if client else "scs"
        sub = "cs" if client else "ss"
        object_ = {"sdo.main_idx": u16(data, 1), "sdo.sub_idx": data[3]}
        running = self.blocks.get(channel)
        if running and running["sender"] == side and not running["ended"] and command != 0x80:
            if command & 0x80 or (command & 0x7F) >= running["size"]:
                running["ended"] = True  # of this sub-block; the acknowledgement says how it goes on
                running["last"] = bool(command & 0x80)
            return "SDO block segment", {"sdo.cmd": command, "c": command >> 7, "sequence": command & 0x7F}
        fields = {"sdo.cmd": command, f"sdo.{side}": command >> 5}
        what = command >> 5
        if what == 4:
            self.blocks.pop(channel, None)
            return "SDO abort", {**fields, **object_, "sdo.abort_code": u32(data, 4)}
        if what in (5, 6):
            return self.block(fields, object_, data, channel, client, sub)
        segment = {"sdo.toggle": command >> 4 & 1, "sdo.n": command >> 1 & 7, "sdo.c": command & 1,
                   "sdo.data.bytes": data[1:].hex()}
        initiate = {**object_, "sdo.n": command >> 2 & 3, "sdo.e": command >> 1 & 1, "sdo.s": command & 1,
                    "sdo.data.bytes": data[4:].hex()}
        toggle = {"sdo.toggle": command >> 4 & 1}
        kinds = {0: ("SDO download segment", segment), 1: ("SDO download", initiate), 2: ("SDO upload", object_),
                 3: ("SDO upload segment", toggle)} if client else \
                {0: ("SDO upload segment", segment), 1: ("SDO download segment", toggle), 2: ("SDO upload", initiate),
                 3: ("SDO download", object_)}
        if what not in kinds:
            return "", {}
        kind, more = kinds[what]
        if what in (1, 2):
            self.blocks.pop(channel, None)
        return kind, {**fields, **more}

    def block(self, fields, object_, data, channel, client, sub):
        command = data[0]
        download = (command >> 5 == 6) == client  # ccs 6 and scs 5 are download, ccs 5 and scs 6 upload
        name = "SDO block download" if download else "SDO block upload"
        step = command & 1 if command >> 5 == 6 else command & 3
        fields[f"sdo.{sub}"] = step
        if command >> 5 == 6:  # who sends the data: initiate, end
            if step == 1:
                self.blocks.pop(channel, None)
                return name + " end", {**fields, "sdo.n": command >> 2 & 7, "sdo.data.bytes": data[1:3].hex()}
            return name + " initiate", {**fields, **object_, "sdo.crc_support": command >> 2 & 1,
                                        "sdo.s": command >> 1 & 1, "sdo.data.bytes": data[4:].hex()}
        if step == 0:  # who receives them
            fields = {**fields, **object_, "sdo.crc_support": command >> 2 & 1, "sdo.blksize": data[4]}
            if not download:
                fields["sdo.pst"] = data[5]
            sender = "ccs" if download else "scs"  # an upload's first sub-block waits for the client's start
            self.blocks[channel] = {"sender": sender, "size": data[4], "ended": not download, "last": False}
            return name + " initiate", fields
        running = self.blocks.get(channel)
        if step == 3:
            if running:
                running.update(sender="scs", ended=False)
            return name + " start", fields
        if step == 2:
            if running:
                done = running["last"]
                running.update(size=data[2], ended=done)
                if done:
                    self.blocks.pop(channel, None)
            return name + " acknowledge", {**fields, "sdo.ackseq": data[1], "sdo.blksize": data[2]}
        self.blocks.pop(channel, None)
        return name + " end", fields


LSS_ADDRESS = {0x40: "vendor", 0x41: "product", 0x42: "revision", 0x43: "serial", 0x46: "vendor", 0x47: "product",
               0x48: "revision_low", 0x49: "revision_high", 0x4A: "serial_low", 0x4B: "serial_high"}
INQUIRED = {0x5A: "vendor", 0x5B: "product", 0x5C: "revision", 0x5D: "serial"}


def lss(data, master):
    command = data[0]
    fields = {"lss.cs": command}
    if master:
        if command == 0x04:
            return "LSS switch global", {**fields, "lss.switch.mode": data[1]}
        if command == 0x11:
            return "LSS node-ID", {**fields, "lss.nid": data[1]}
        if command == 0x13:
            return "LSS bit timing", {**fields, "lss.bt.tbl_selector": data[1], "lss.bt.tbl_index": data[2]}
        if command == 0x15:
            return "LSS activate", {**fields, "lss.abt_delay": u16(data, 1)}
        if command == 0x17:
            return "LSS store", fields
        if command in LSS_ADDRESS:
            kind = "LSS select" if command < 0x46 else "LSS identify"
            return kind, {**fields, f"lss.addr.{LSS_ADDRESS[command]}": u32(data, 1)}
        if command == 0x4C:
            return "LSS identify non-configured", fields
        if command == 0x51:
            return "LSS Fastscan", {**fields, "lss.fastscan.id": u32(data, 1), "lss.fastscan.check": data[5],
                                    "lss.fastscan.sub": data[6], "lss.fastscan.next": data[7]}
        if 0x5A <= command <= 0x5E:
            return "LSS inquire", fields
        return "", {}
    if command in (0x11, 0x13, 0x17):
        kind, name = {0x11: ("LSS node-ID", "conf_id"), 0x13: ("LSS bit timing", "conf_bt"),
                      0x17: ("LSS store", "store_conf")}[command]
        return kind + " answer", {**fields, f"lss.{name}.err_code": data[1], "lss.spec_err": data[2]}
    if command in (0x44, 0x4F, 0x50):
        return {0x44: "LSS select answer", 0x4F: "LSS identify answer", 0x50: "LSS non-configured answer"}[command], fields
    if command in INQUIRED:
        return "LSS inquire answer", {**fields, f"lss.addr.{INQUIRED[command]}": u32(data, 1)}
    if command == 0x5E:
        return "LSS inquire answer", {**fields, "lss.nid": data[1]}
    return "", {}
