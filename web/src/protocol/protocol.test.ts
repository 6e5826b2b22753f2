import { describe, expect, it } from "vitest";
import { batchesOfRows, decodeBatch, frameOf } from "./batch";
import { commandLine } from "./command";
import type { Parameter, Verb } from "./messages";
import { addressOf, serialWords, typeWords, visible } from "./text";

function message(frames: { id: number; length: number; data: number[]; after: number }[]): ArrayBuffer {
  const bytes: number[] = [1, 1, frames.length, 0, 0, 0, 0, 0];
  const put = (value: bigint, width: number) => {
    for (let i = 0; i < width; i++) bytes.push(Number((value >> BigInt(8 * i)) & 255n));
  };
  put(5_000_000_000n, 8);
  put(1_500_000_000n, 8);
  for (const frame of frames) {
    put(BigInt(frame.after), 4);
    put(BigInt(frame.id), 4);
    bytes.push(2, frame.length, ...frame.data);
  }
  return Uint8Array.from(bytes).buffer;
}

describe("a binary batch", () => {
  it("is read as the contract has it", () => {
    const batch = decodeBatch(
      message([
        { id: 0x705, length: 0x81, data: [5], after: 0 },
        { id: 0x80000000 + 0x1f940000, length: 4, data: [0x80, 0, 0, 0], after: 250 },
      ]),
    );
    expect(batch?.first).toBe(5_000_000_000);
    const [first, second] = batch ? [frameOf(batch, 0), frameOf(batch, 1)] : [];
    expect(first).toMatchObject({ id: 0x705, sent: true, extended: false, bus: 2, seconds: 1.5 });
    expect(second).toMatchObject({ id: 0x1f940000, extended: true, sent: false, n: 5_000_000_001 });
    expect(second?.seconds).toBeCloseTo(1.50025, 9);
    expect([...(second?.data ?? [])]).toEqual([0x80, 0, 0, 0]);
  });
  it("has remote frames with a length and no bytes", () => {
    const other = { id: 0x181, length: 1, data: [7], after: 1 };
    const batch = decodeBatch(message([{ id: 0x40000000 + 0x701, length: 2, data: [], after: 0 }, other]));
    expect(batch && frameOf(batch, 0)).toMatchObject({ id: 0x701, remote: true, data: { length: 2 } });
    expect(batch && frameOf(batch, 1).id).toBe(0x181);
    const row = { n: 1, t_s: 1, bus: "a", id: 0x701, ext: false, rtr: true, data: "", text: "", dlc: 2 };
    expect(batchesOfRows([row], ["a"])[0]?.lengths[0]).toBe(2);
  });
  it("is refused when it is cut short, too long or of another version", () => {
    const good = message([{ id: 1, length: 2, data: [1, 2], after: 0 }]);
    expect(decodeBatch(good.slice(0, -1))).toBeNull();
    expect(decodeBatch(Uint8Array.from([...new Uint8Array(good), 0]).buffer)).toBeNull();
    const other = new Uint8Array(good.slice(0));
    other[1] = 2;
    expect(decodeBatch(other.buffer)).toBeNull();
  });
  it("is made of the server's rows, one for each run of numbers", () => {
    const row = { t_s: 1, bus: "b", id: 0x701, ext: false, rtr: false, data: "05", text: "" };
    const batches = batchesOfRows(
      [4, 5, 9].map((n) => ({ ...row, n })),
      ["a", "b"],
    );
    expect(batches.map(({ first, count }) => [first, count])).toEqual([
      [4, 2],
      [9, 1],
    ]);
    expect(batches[0]?.buses[0]).toBe(1);
  });
});

const parameter = (name: string, form: Parameter["form"]): Parameter => ({
  name,
  form,
  help: "",
  required: false,
  value: "",
});
const verbs: Verb[] = [
  {
    name: "replace",
    help: "",
    changes: true,
    role: "configure",
    parameters: [
      parameter("bus", "common"),
      parameter("slot", "word"),
      parameter("device", "option"),
      parameter("used", "flag"),
    ],
  },
  {
    name: "sdo write",
    help: "",
    changes: true,
    role: "configure",
    parameters: [
      parameter("bus", "common"),
      parameter("node", "word"),
      parameter("object", "own"),
      parameter("value", "own"),
    ],
  },
];

describe("a request as a command", () => {
  it("has words in the table's order, then options", () => {
    const values = { device: "00000001-00000002-00010000-00000015", slot: "left drive", bus: "field", used: "1" };
    expect(commandLine("replace", values, verbs, "m.toml")).toBe(
      "berth replace 'left drive' --bus field --device 00000001-00000002-00010000-00000015 --used -m m.toml",
    );
    expect(commandLine("sdo write", { value: "500", object: "1017h:00", node: "5" }, verbs, "")).toBe(
      "berth sdo write 5 1017h:00 500",
    );
  });
  it("has the command line's names", () => {
    const sim = (values: Record<string, string>) => commandLine("sim", values, [], "m.toml");
    expect(sim({ action: "power-off", device: "s2" })).toBe("berth sim power off s2 -m m.toml");
    expect(sim({ action: "deaf", device: "s2", duration: "5 s" })).toBe(
      "berth sim fault deaf s2 'duration=5 s' -m m.toml",
    );
    expect(sim({ action: "cut-cable", nodes: "s1\ns 2", bus: "field" })).toBe(
      "berth sim fault cut-cable 'nodes=s1,s 2' --bus field -m m.toml",
    );
    expect(sim({ action: "devices" })).toBe("berth sim devices -m m.toml");
    const store = { ...parameter("store", "flag"), spelled: "--save" };
    const verb = { name: "lss set-node-id", help: "", changes: true, role: "configure" as const, parameters: [store] };
    expect(commandLine(verb.name, { store: "1" }, [verb], "")).toBe("berth lss set-node-id --save");
    expect(commandLine("world pause", {}, [], "")).toBe("berth world pause");
  });
  it("quotes whatever a name holds", () => {
    expect(commandLine("replace", { slot: "it's; rm -rf $(x)" }, verbs, "")).toBe(
      "berth replace 'it'\\''s; rm -rf $(x)'",
    );
    expect(commandLine("replace", { slot: "a\nb" }, verbs, "")).toBe("berth replace $'a\\x0ab'");
  });
});

describe("texts", () => {
  it("show what a name hides", () => {
    expect(visible("a\u0007b\u202ec<b>")).toBe("a\\x07b\\u202ec<b>");
  });
  it("name types and serial numbers", () => {
    expect(typeWords("0x0000000100000042")).toBe("1h / 42h");
    expect(serialWords("0x00010001000003E9")).toEqual({ revision: "10001h", serial: "3E9h" });
    expect(addressOf("0x0000000100000042", "0x00010001000003E9")).toBe("00000001-00000042-00010001-000003E9");
    expect(addressOf("0x0000000100000042", null)).toBeNull();
  });
});
