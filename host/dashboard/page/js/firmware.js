// New firmware for a hub with a bootloader: sends a file to the server in parts, and shows the progress.

import { chooser, h, hexOf, setText } from "./dom.js";
import { mayOrder, on, onControl, state } from "./state.js";

/** Bytes of a part. An order has at most 16 KiB. */
const PART = 6000;
/** Largest image in bytes: more than the flash of any supported chip. */
const LARGEST = 4 << 20;
/** First bytes of an ELF file of 32 bits, the length of its header, and the type of a segment that is loaded. */
const [ELF, HEADER, LOAD] = [[0x7f, 0x45, 0x4c, 0x46, 1, 1], 52, 1];
/** First characters and largest length of the version text in each image. */
const [VERSION, LONGEST] = ["HW: 20, Maj: ", 40];

/** Bytes of a file in flash. Those of an ELF file begin at its lowest address; gaps are filled with 0xFF, as erased flash is. */
function flashOf(/** @type {Uint8Array} */ file) {
  if (!ELF.every((byte, index) => file[index] === byte)) return file;
  const cut = new Error("the ELF file is cut off: build or copy it again");
  if (file.length < HEADER) throw cut;
  const view = new DataView(file.buffer);
  const [headers, size, count] = [view.getUint32(28, true), view.getUint16(42, true), view.getUint16(44, true)];
  if (headers + count * size > file.length) throw cut;
  const segments = Array.from({ length: count }, (_, index) => {
    const [type, from, , at, length] = [0, 4, 8, 12, 16].map((field) => view.getUint32(headers + index * size + field, true));
    return { loaded: type === LOAD && length > 0, at, length, data: file.subarray(from, from + length) };
  }).filter(({ loaded }) => loaded);
  if (segments.some(({ data, length }) => data.length < length)) throw cut;
  const origin = Math.min(...segments.map(({ at }) => at));
  const length = Math.max(...segments.map(({ at, data }) => at + data.length)) - origin;
  if (!(length <= LARGEST)) throw new Error("it has no segments for one flash");
  const image = new Uint8Array(length).fill(0xff);
  for (const { at, data } of segments) image.set(data, at - origin);
  return image;
}

/** The version text of an image. Throws an error that says what is wrong. */
function versionOf(/** @type {Uint8Array} */ bytes) {
  const text = new TextDecoder("latin1").decode(bytes);
  const at = text.indexOf(VERSION);
  const end = text.indexOf("\0", at);
  if (at < 0 || end < 0 || end - at > LONGEST) throw new Error("it is no motor-hub firmware: it has no version text");
  return text.slice(at, end);
}

/** @param {any} link */
export function firmwareForm(link) {
  const says = h("p", { role: "status" }, "The hub must have a bootloader. All motors must be disabled.");
  const progress = h("progress", { max: 100, value: 0, "aria-label": "Progress of the new firmware" });
  let running = false;
  /** @type {{signature: File|null, key: File|null}} the files that sign the next image */
  const seal = { signature: null, key: null };

  /** Ends a transfer that the server does not continue. */
  function end(/** @type {string} */ words) {
    running = false;
    setText(says, words);
    allow();
  }
  async function send(/** @type {File} */ chosen) {
    running = true;
    allow();
    try {
      const file = new Uint8Array(await chosen.arrayBuffer());
      const bytes = flashOf(file);
      if (bytes.length > LARGEST) throw new Error(`it has ${bytes.length} bytes; allowed are at most ${LARGEST}`);
      const version = versionOf(bytes);
      const { signature, key } = seal;
      if (Boolean(signature) !== Boolean(key)) throw new Error(`a signed image needs a signature and a key: choose the ${signature ? "key" : "signature"} too`);
      if (signature && bytes !== file) throw new Error("it is an ELF file, but a signature needs raw bytes: make them by llvm-objcopy -O binary, then sign and send them");
      const hex = async (/** @type {File|null} */ one) => (one ? hexOf(new Uint8Array(await one.arrayBuffer())) : "");
      progress.value = 0;
      setText(says, `${chosen.name} is sent …`);
      const sealed = signature && { signature: await hex(signature), key: await hex(key) };
      for (let offset = 0; offset < bytes.length; offset += PART) link.order("firmware", { offset, hex: hexOf(bytes.subarray(offset, offset + PART)) });
      if (!link.order("update", { version, seal: sealed })) throw new Error("the connection to the program is lost: send the file again");
    } catch (error) {
      end(`${chosen.name}: ${/** @type {Error} */ (error).message}.`);
    }
  }
  const [image, imageField] = chooser("Send new firmware", "firmware-file", send);
  image.classList.add("primary");
  const names = h("span", { class: "muted" });
  function sign(/** @type {"signature"|"key"|null} */ what, /** @type {File|null} */ file = null) {
    if (what) seal[what] = file;
    else [seal.signature, seal.key] = [null, null];
    setText(names, `Signature: ${seal.signature?.name ?? "none"}. Key: ${seal.key?.name ?? "none"}.`);
  }
  sign(null);
  const [signature, signatureField] = chooser("Signature …", "firmware-signature", (file) => sign("signature", file));
  const [key, keyField] = chooser("Public key …", "firmware-key", (file) => sign("key", file));
  const unsigned = h("button", { type: "button", onclick: () => sign(null) }, "Neither");

  function allow() {
    image.disabled = running || !(mayOrder() && state.reports);
  }
  on("update", ({ state: is, percent, text }) => {
    running = is === "running";
    progress.value = percent;
    setText(says, is === "failed" ? `The update failed: ${text}.` : is === "done" ? `The update is done: ${text}.` : `${text} ${percent} %`);
    allow();
  });
  // An answer does not name its order. While a file is sent, a refusal is taken for one of the file.
  on("refused", ({ why }) => { if (says.textContent?.endsWith("…")) end(`The firmware is refused: ${why}.`); });
  on("open", () => {
    if (!state.open && running) end("The connection to the program was lost. Once it is back, the version under This hub says whether the update is done.");
  });
  onControl(allow);
  return h("div", { class: "stack" },
    says, progress, h("div", { class: "row" }, image, imageField),
    h("p", { class: "muted" }, "A hub that was built with a key takes only firmware that the key's owner has signed. Choose signature and public key first, then the firmware as raw bytes."),
    h("div", { class: "row" }, signature, key, unsigned, signatureField, keyField), names);
}
