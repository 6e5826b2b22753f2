import { expect, it } from "vitest";
import { commandLine } from "../../protocol/command";
import { deviceActs } from "./acts";

it("each act on a device is a command of `berth sim`", () => {
  const lines = deviceActs("s2").map((act) => commandLine(act.verb, act.values, [], ""));
  expect(lines).toEqual([
    "berth sim unplug s2",
    "berth sim plug s2",
    "berth sim power off s2",
    "berth sim power on s2",
    "berth sim fault deaf s2 'duration=5 s'",
    "berth sim fault slow s2 'latency=50 ms'",
  ]);
});
