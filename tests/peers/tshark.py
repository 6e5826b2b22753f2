"""tshark's CANopen dissector as judge: what it reads in each frame of a trace file, and where it is known to be wrong."""

import subprocess

FIELDS = ["nmt_ctrl.cd", "nmt_ctrl.node_id", "nmt_guard.toggle", "nmt_guard.state", "sync.counter", "em.err_code",
          "em.err_reg", "em.err_field", "time_stamp_ms", "time_stamp_days", "pdo.data.bytes", "sdo.cmd", "sdo.ccs", "sdo.scs",
          "sdo.cs", "sdo.ss", "sdo.crc_support", "sdo.n", "sdo.e", "sdo.s", "sdo.toggle", "sdo.c", "sdo.main_idx",
          "sdo.sub_idx", "sdo.data.bytes", "sdo.abort_code", "sdo.ackseq", "sdo.blksize", "sdo.pst", "lss.cs",
          "lss.addr.vendor", "lss.addr.product", "lss.addr.revision", "lss.addr.revision_low", "lss.addr.revision_high",
          "lss.addr.serial", "lss.addr.serial_low", "lss.addr.serial_high", "lss.fastscan.id", "lss.fastscan.check",
          "lss.fastscan.sub", "lss.fastscan.next", "lss.switch.mode", "lss.nid", "lss.conf_id.err_code",
          "lss.conf_bt.err_code", "lss.store_conf.err_code", "lss.spec_err", "lss.bt.tbl_selector", "lss.bt.tbl_index",
          "lss.abt_delay"]
BYTES = {"em.err_field", "pdo.data.bytes", "sdo.data.bytes"}


class Reading:
    """One frame as tshark reads it."""

    def __init__(self, row):
        number, identifier, length, malformed, *values = row.split("\t")
        self.number = int(number)
        self.id = int(identifier or "-1", 0)
        self.length = int(length or "-1", 0)
        self.malformed = bool(malformed)
        self.fields = {}
        for name, value in zip(FIELDS, values):
            if value:
                first = value.split(",")[0]
                self.fields[name] = first.replace(":", "") if name in BYTES else int(first, 0)


def read(path):
    """Every frame of a trace file of any format that tshark knows: candump logs, pcapng, Vector ASC."""
    command = ["tshark", "-n", "-d", "can.subdissector,canopen", "-r", path, "-T", "fields", "-E", "occurrence=a",
               "-e", "frame.number", "-e", "can.id", "-e", "can.len", "-e", "_ws.malformed"]
    for name in FIELDS:
        command += ["-e", "canopen." + name]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    if done.returncode != 0:
        raise AssertionError(f"tshark: status {done.returncode}: {done.stderr}")
    return [Reading(row) for row in done.stdout.splitlines()]


def known_to_be_wrong(frame, kind):
    """Why tshark's reading of this frame proves nothing, or None. Seen with 4.0.17 (Debian 12)."""
    if kind == "SDO block segment":
        return "the dissector keeps no state: a segment of a block transfer is read by the bits of its sequence number"
    if kind in ("SDO block download initiate", "SDO block upload initiate") and frame.data[0] & 0x06:
        return "with the CRC bit or the size bit set it looks the sub-command up by all of the low bits and finds none"
    if frame.plain() and 0x001 <= frame.id <= 0x07F:
        return "identifiers 001h to 07Fh (fail-safe command, flying master, redundancy) are read as NMT commands"
    if frame.plain() and frame.id == 0 and len(frame.data) != 2:
        return "an NMT command of another length is none (CiA 301), and it reads on all the same"
    return None
