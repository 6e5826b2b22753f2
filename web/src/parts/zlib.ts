/** What DCFs travel as: a zlib stream in hexadecimal digits. */

async function through(bytes: BlobPart, pipe: CompressionStream | DecompressionStream): Promise<Uint8Array> {
  const stream = new Blob([bytes]).stream().pipeThrough(pipe);
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function packed(bytes: BlobPart): Promise<string> {
  const data = await through(bytes, new CompressionStream("deflate"));
  return Array.from(data, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Rejects what is no such stream. */
export async function unpacked(digits: string): Promise<Uint8Array> {
  if (digits.length % 2 || !/^[0-9a-f]*$/i.test(digits)) throw new Error("no hexadecimal digits");
  const data = new Uint8Array(digits.length / 2);
  for (let i = 0; i < data.length; i++) data[i] = parseInt(digits.slice(2 * i, 2 * i + 2), 16);
  return through(data, new DecompressionStream("deflate"));
}
