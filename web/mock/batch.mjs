/** The binary message of the contract. */
export function encodeBatch(frames) {
  const parts = frames.map((frame) => Buffer.from(frame.data, "hex"));
  const size = 24 + parts.reduce((sum, data) => sum + 10 + data.length, 0);
  const buffer = Buffer.alloc(size);
  buffer.writeUInt8(1, 0);
  buffer.writeUInt8(1, 1);
  buffer.writeUInt16LE(frames.length, 2);
  buffer.writeBigUInt64LE(BigInt(frames[0].n), 8);
  let before = Math.round(frames[0].t * 1e6);
  buffer.writeBigUInt64LE(BigInt(before) * 1000n, 16);
  let at = 24;
  frames.forEach((frame, i) => {
    const now = Math.round(frame.t * 1e6);
    buffer.writeUInt32LE(Math.max(0, now - before), at);
    before = Math.max(before, now);
    buffer.writeUInt32LE((frame.id | (frame.rtr ? 0x40000000 : 0) | (frame.ext ? 0x80000000 : 0)) >>> 0, at + 4);
    buffer.writeUInt8(frame.bus, at + 8);
    const sent = frame.id >= 0x600 && frame.id < 0x680 ? 0x80 : 0;
    buffer.writeUInt8((frame.rtr ? frame.dlc : parts[i].length) | sent, at + 9);
    parts[i].copy(buffer, at + 10);
    at += 10 + parts[i].length;
  });
  return buffer;
}
