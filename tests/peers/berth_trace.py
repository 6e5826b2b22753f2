"""What `berth trace --frames --json` says of a frame must be what tshark's fields say of it."""

import json

from support import berth

NMT = {0x01: "start", 0x02: "stop", 0x80: "enter pre-operational", 0x81: "reset node", 0x82: "reset communication"}
STATE = {0: "Boot up", 4: "stopped", 5: "operational", 127: "pre-operational"}
# By command specifier, for who asks and who answers.
CLIENT = {0: "download segment", 1: "write", 2: "read", 3: "upload segment", 4: "abort", 5: "block", 6: "block"}
SERVER = {0: "upload segment", 1: "download segment", 2: "value of", 3: "written", 4: "abort", 5: "block", 6: "block"}
LSS_MASTER = {0x04: "Switch Mode Global", 0x11: "Configure Node ID", 0x13: "Configure Bit Timing",
              0x15: "Activate Bit Timing", 0x17: "Store Configuration", 0x40: "Selective - Vendor ID",
              0x41: "Selective - Product Code", 0x42: "Selective - Revision Nr.", 0x43: "Selective - Serial Nr.",
              0x46: "Remote Servants - Vendor ID", 0x47: "Remote Servants - Product Code",
              0x48: "Remote Servants - Revision Nr. from", 0x49: "Remote Servants - Revision Nr. to",
              0x4A: "Remote Servants - Serial Nr. from", 0x4B: "Remote Servants - Serial Nr. to",
              0x4C: "Identify Non-Configured Servants", 0x51: "Fastscan", 0x5A: "Inquire Vendor ID",
              0x5B: "Inquire Product Code", 0x5C: "Inquire Revision Nr.", 0x5D: "Inquire Serial Nr.", 0x5E: "Inquire Node ID"}
LSS_SLAVE = {0x11: "Configure Node ID", 0x13: "Configure Bit Timing", 0x17: "Store Configuration",
             0x44: "Switch Mode Selective - Success", 0x4F: "Identify Servant", 0x50: "Identify Non-Configured Servant",
             0x5A: "Inquire Vendor ID", 0x5B: "Inquire Product Code", 0x5C: "Inquire Revision Nr.",
             0x5D: "Inquire Serial Nr.", 0x5E: "Inquire Node ID"}
FASTSCAN_PART = ["Vendor ID", "Product Code", "Revision Nr.", "Serial Nr."]


def rows(path):
    """One a frame. Findings (logs one behind the other: the time goes back) are none."""
    said = [json.loads(line) for line in berth("trace", path, "--frames", "--json", timeout=180).splitlines()]
    return [row for row in said if "frame" in row]


def expected(reading):
    """(JSON values, words) that a frame's row must have, from tshark's fields; empty for what is not compared."""
    fields = reading.fields
    values, words = {}, []
    if "nmt_ctrl.cd" in fields:
        node = fields["nmt_ctrl.node_id"]
        values["service"] = "nmt"
        words += [NMT[fields["nmt_ctrl.cd"]], f"node {node}" if node else "all nodes"]
    elif "em.err_code" in fields:
        values = {"service": "emcy", "node": reading.id & 0x7F, "code": f"{fields['em.err_code']:04X}",
                  "register": fields["em.err_reg"]}
    elif "nmt_guard.state" in fields:
        values = {"service": "heartbeat", "node": reading.id & 0x7F}
        words.append(STATE[fields["nmt_guard.state"]])
    elif "sdo.cmd" in fields:
        values = {"service": "sdo", "node": reading.id & 0x7F}
        words.append(CLIENT[fields["sdo.ccs"]] if "sdo.ccs" in fields else SERVER[fields["sdo.scs"]])
        if "sdo.main_idx" in fields:
            values["object"] = f"{fields['sdo.main_idx']:04X}h:{fields['sdo.sub_idx']:02X}"
        if "sdo.abort_code" in fields:
            values["abort"] = f"{fields['sdo.abort_code']:08X}"
    elif "lss.cs" in fields:
        values["service"] = "lss"
        words += lss(reading.id == 0x7E5, fields)
    elif reading.id == 0x80:
        values["service"] = "sync"
        if "sync.counter" in fields:
            words.append(f"counter {fields['sync.counter']}")
    elif "time_stamp_ms" in fields:
        values["service"] = "time"
        ms = fields["time_stamp_ms"]
        words.append(f"{ms // 3600000:02}:{ms // 60000 % 60:02}:{ms // 1000 % 60:02}.{ms % 1000:03}")
    return values, words


def lss(master, fields):
    command = fields["lss.cs"]
    words = [(LSS_MASTER if master else LSS_SLAVE)[command]]
    if master and command == 0x51:
        check = fields["lss.fastscan.check"]
        return words + (["Checking for new nodes"] if check == 0x80 else
                        [FASTSCAN_PART[fields["lss.fastscan.sub"]], f"Checking bits {check} - 31"])
    for name, value in fields.items():
        if name.startswith("lss.addr."):
            words.append(f"0x{value:08X}")
        elif name == "lss.nid":
            words.append(f"0x{value:02X}")
        elif name == "lss.switch.mode":
            words.append(["Operation Mode", "Configuration Mode"][value])
        elif name == "lss.abt_delay":
            words.append(f"{value} ms")
        elif name == "lss.bt.tbl_index":
            words.append(f"Index: {value}")
        elif name.endswith(".err_code"):
            words.append(f"Error {value}" if value else "Success")
    return words
