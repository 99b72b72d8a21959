// Recordings as MCAP: a file of JSON messages, a channel for each motor, without an index.

const MAGIC = new Uint8Array([0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a]);
const OPCODES = { header: 1, footer: 2, schema: 3, channel: 4, message: 5, end: 15 };
const SCHEMA = 1;
const utf8 = new TextEncoder();

const number = (/** @type {8|16|32|64} */ bits, /** @type {number|bigint} */ value) => {
  const view = new DataView(new ArrayBuffer(bits / 8));
  if (bits === 64) view.setBigUint64(0, BigInt(value), true);
  else view[bits === 32 ? "setUint32" : bits === 16 ? "setUint16" : "setUint8"](0, Number(value), true);
  return new Uint8Array(view.buffer);
};
const text = (/** @type {string} */ words) => {
  const bytes = utf8.encode(words);
  return [number(32, bytes.length), bytes];
};

/** A record: opcode, length, contents. */
function record(/** @type {keyof typeof OPCODES} */ kind, /** @type {Uint8Array[]} */ ...parts) {
  return [number(8, OPCODES[kind]), number(64, parts.reduce((sum, part) => sum + part.length, 0)), ...parts];
}

/**
 * A recording as a file. Its rows come in pieces, so that a long recording is never in memory as a whole.
 * @param {AsyncIterable<{motor: number, at_s: number, values: Record<string, any>}[]>} pieces
 * @param {number} begun time of the recording's start in milliseconds since 1970
 */
export async function mcap(pieces, begun) {
  /** @type {Blob[]} */
  const parts = [];
  const add = (/** @type {Uint8Array[]} */ bytes) => parts.push(new Blob(/** @type {BlobPart[]} */ (bytes)));
  let [first, index] = [0, 0];
  for await (const rows of pieces) {
    if (!rows.length) continue;
    if (!parts.length) {
      first = rows[0].at_s;
      add(head(rows));
    }
    add(rows.flatMap(({ motor, at_s, values }) => {
      const at = number(64, BigInt(begun) * 1000000n + BigInt(Math.round((at_s - first) * 1e9)));
      return record("message", number(16, motor), number(32, index++), at, at, utf8.encode(JSON.stringify(values)));
    }));
  }
  add([...record("end", number(32, 0)), ...record("footer", number(64, 0), number(64, 0), number(32, 0)), MAGIC]);
  return new Blob(parts);
}

/** The records before the messages: columns and motors are those of the first rows. */
function head(/** @type {{motor: number, values: Record<string, any>}[]} */ rows) {
  const properties = Object.fromEntries(Object.keys(rows[0].values).map((name) => [name, { type: ["number", "string", "null"] }]));
  const schema = JSON.stringify({ type: "object", properties });
  const motors = [...new Set(rows.map(({ motor }) => motor))];
  return [MAGIC,
    ...record("header", ...text(""), ...text("motor-hub dashboard")),
    ...record("schema", number(16, SCHEMA), ...text("motor"), ...text("jsonschema"), ...text(schema)),
    ...motors.flatMap((motor) => record("channel", number(16, motor), number(16, SCHEMA), ...text(`/motor/${motor}`), ...text("json"), number(32, 0)))];
}
