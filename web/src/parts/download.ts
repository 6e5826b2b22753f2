/** Gives the person a file that the page made. */
export function download(name: string, content: BlobPart, type: string): void {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
  // The browser needs the address until it has begun.
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** "conveyor-2026-11-28-1605.csv": no characters that a file system does not take. */
export function fileName(name: string, ending: string, now: Date): string {
  const clean = name.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || "berth";
  const two = (value: number) => String(value).padStart(2, "0");
  const day = `${now.getFullYear()}-${two(now.getMonth() + 1)}-${two(now.getDate())}`;
  return `${clean}-${day}-${two(now.getHours())}${two(now.getMinutes())}.${ending}`;
}

/** A field of a CSV file (RFC 4180). A cell that a table would take for a formula is kept text. */
export function cell(value: string | number): string {
  if (typeof value === "number") return String(value);
  const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

export const csv = (rows: readonly (readonly (string | number)[])[]): string =>
  rows.map((row) => row.map(cell).join(",") + "\r\n").join("");
