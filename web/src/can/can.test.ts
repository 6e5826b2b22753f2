import { describe, expect, it } from "vitest";
import { bytesOf } from "../protocol/batch";
import { crcOf, fieldRuns, fieldValue, wireBits, type WireFrame } from "./bits";
import { abortParts, meaningOf } from "./words";

function frame(text: string): WireFrame {
  const [id = "", data = ""] = text.split("#");
  return { id: parseInt(id, 16), extended: id.length > 3, remote: data === "R", data: bytesOf(data.replace("R", "")) };
}

describe("the bits of a frame", () => {
  // docs/protocols/can-frames.md, Lengths; tests/can/length_test.cpp
  it.each([
    ["080#", 51],
    ["000#0100", 68],
    ["701#05", 58],
    ["77F#7F", 59],
    ["081#0000000000000000", 126],
    ["181#FFFFFFFFFFFFFFFF", 124],
    ["181#5555555555555555", 112],
    ["601#4000100000000000", 124],
    ["000#8200", 69],
    ["701#R", 49],
    ["7E5#5100000000800000", 123],
    ["7E4#4F00000000000000", 126],
    ["1F900135#", 70],
    ["00000100#", 74],
    ["1F940000#8000000000000000", 148],
    ["1F940000#80080005", 109],
  ])("%s has %i", (text, length) => {
    expect(wireBits(frame(text))).toHaveLength(length);
  });

  it("never has six equal bits before the CRC delimiter", () => {
    for (let n = 0; n < 500; n++) {
      const data = Uint8Array.from({ length: n % 9 }, (_, i) => (n % 3 === 0 ? 0 : (n * 31 * (i + 7)) & 255));
      const bits = wireBits({ id: (n * 37) & 0x7ff, extended: false, remote: false, data });
      const stuffed = bits.slice(
        0,
        bits.findIndex((bit) => bit.field === "CRC del"),
      );
      expect(stuffed.map((bit) => bit.value).join("")).not.toMatch(/0{6}|1{6}/);
    }
  });

  it("has a CRC that divides: the check over data and CRC is 0", () => {
    const bits = wireBits(frame("601#4018100400000000")).filter((bit) => !bit.stuff);
    const upToCrc = bits
      .slice(
        0,
        bits.findIndex((bit) => bit.field === "CRC del"),
      )
      .map((bit) => bit.value);
    let rest = 0;
    for (const bit of [...upToCrc]) {
      const top = ((rest >> 14) & 1) ^ bit;
      rest = ((rest << 1) & 0x7fff) ^ (top ? 0x4599 : 0);
    }
    expect(rest).toBe(0);
  });

  it("has named fields with their values", () => {
    const runs = fieldRuns(wireBits(frame("181#A55A")));
    expect(runs.map((run) => run.field)).toEqual([
      "SOF",
      "ID",
      "RTR",
      "IDE",
      "r0",
      "DLC",
      "data",
      "data",
      "CRC",
      "CRC del",
      "ACK",
      "ACK del",
      "EOF",
      "IFS",
    ]);
    expect(runs.filter((run) => run.field === "data").map(fieldValue)).toEqual([0xa5, 0x5a]);
    expect(runs.filter((run) => run.field === "CRC").map(fieldValue)).toEqual([crcOf(frame("181#A55A"))]);
  });
});

describe("the meaning of a frame", () => {
  const words = (text: string) => {
    const { id, extended, remote, data } = frame(text);
    return meaningOf(id, extended, remote, data);
  };
  it.each([
    ["000#8105", "NMT", "NMT: reset node, node 5"],
    ["705#05", "heartbeat", "Heartbeat of node 5: operational"],
    ["705#00", "heartbeat", "Boot-up of node 5: boot-up"],
    ["705#R", "heartbeat", "Node guarding request to node 5"],
    ["605#4018100400000000", "SDO", "SDO to node 5: read 1018h:04"],
    ["585#4318100401000000", "SDO", "SDO of node 5: value of 1018h:04"],
    ["585#8000100000000206", "abort", "SDO of node 5: abort 1000h:00, 06020000h, object does not exist"],
    ["1E1#0000", "PDO1", "TPDO 1 of node 97"],
    ["23A#00", "PDO1", "RPDO 1 of node 58"],
    ["50A#00", "PDO4", "RPDO 4 of node 10"],
    ["08A#1081010000000000", "EMCY", "EMCY of node 10: 8110h"],
    ["7E5#4C00000000000000", "LSS", "LSS identify non-configured slaves"],
    ["1F940000#80030100", "RAND", "RAND request, phase 3, mask 0100h"],
  ])("%s", (text, service, meaning) => {
    expect(words(text)).toMatchObject({ service, text: meaning });
  });

  it("has an abort's object and reason first, what the server calls the node last", () => {
    const [object, code] = ["abort 1018h:01", "06010002h"];
    const parts = (text: string) => abortParts(text);
    expect(parts(`SDO of node 2: ${object}, ${code}, attempt to write, a read-only object`)).toEqual({
      object,
      reason: "attempt to write, a read-only object",
      rest: `${code}, SDO of node 2`,
    });
    expect(parts(`SDO to node 2 [a: b, c]: ${object}, ${code}, no data`)?.rest).toBe(
      `${code}, SDO to node 2 [a: b, c]`,
    );
    expect(parts(`SDO of node 2: ${object}, ${code}`)).toEqual({ object, reason: code, rest: "SDO of node 2" });
    expect(parts("SDO of node 2: value of 1018h:01")).toBeNull();
    expect(parts(meaningOf(0x582, false, false, bytesOf("8018100102000106")).text)?.reason).toMatch(/read-only/);
  });
});
