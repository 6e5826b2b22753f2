/** Names come from devices and files and may be anything: control characters are shown, never obeyed. */
export function visible(text: string): string {
  // eslint-disable-next-line no-control-regex
  return text.replace(/[\u0000-\u001f\u007f-\u009f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]/g, (char) => {
    const code = char.charCodeAt(0);
    const digits = code.toString(16);
    return code < 0x100 ? `\\x${digits.padStart(2, "0")}` : `\\u${digits.padStart(4, "0")}`;
  });
}

/** 1018 -> "3FAh" */
export function hex(value: number, digits = 0): string {
  return `${(value >>> 0).toString(16).toUpperCase().padStart(digits, "0")}h`;
}

/** "F4 01" */
export function bytes(data: Uint8Array): string {
  let text = "";
  for (const byte of data) text += (text ? " " : "") + (byte < 16 ? "0" : "") + byte.toString(16).toUpperCase();
  return text;
}

/** "12.345 s" */
export function seconds(value: number, digits = 3): string {
  return `${value.toFixed(digits)} s`;
}

export function count(value: number): string {
  return Math.round(value).toLocaleString("en-GB");
}

/** "0x0000000100000042" -> "1h / 42h": vendor-ID and product code */
export function typeWords(type: string | null): string {
  const match = /^0x([0-9a-f]{8})([0-9a-f]{8})$/i.exec(type ?? "");
  return match ? `${hex(parseInt(match[1] ?? "", 16))} / ${hex(parseInt(match[2] ?? "", 16))}` : "";
}

/** "0x0001000100000007" -> { revision: "10001h", serial: "7h" } */
export function serialWords(rSn: string | null): { revision: string; serial: string } {
  const match = /^0x([0-9a-f]{8})([0-9a-f]{8})$/i.exec(rSn ?? "");
  if (!match) return { revision: "", serial: "" };
  return { revision: hex(parseInt(match[1] ?? "", 16)), serial: hex(parseInt(match[2] ?? "", 16)) };
}

/** The LSS address of a slot's device as commands take it, or null. */
export function addressOf(type: string | null, rSn: string | null): string | null {
  const both = /^0x([0-9a-f]{8})([0-9a-f]{8})$/i;
  const a = both.exec(type ?? "");
  const b = both.exec(rSn ?? "");
  return a && b ? [a[1], a[2], b[1], b[2]].join("-").toUpperCase() : null;
}

/** "00000001-00000042-00010001-00000007" -> type "1h / 42h", revision "10001h", serial "7h" */
export function addressWords(address: string): { type: string; revision: string; serial: string } {
  const [vendor = "", product = "", revision = "", serial = ""] = address
    .split("-")
    .map((word) => hex(parseInt(word, 16)));
  return { type: `${vendor} / ${product}`, revision, serial };
}

export const LSS_ADDRESS = /\b[0-9A-F]{8}-[0-9A-F]{8}-[0-9A-F]{8}-[0-9A-F]{8}\b/i;
