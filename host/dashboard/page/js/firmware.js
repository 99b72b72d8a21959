// New firmware for a hub with a bootloader: sends a file to the server in parts, and shows the progress.

import { h, say } from "./dom.js";
import { inControl, on, state } from "./state.js";

/** Bytes of a part. An order has at most 16 KiB. */
const PART = 6000;
/** Largest image in bytes: more than the flash of any supported chip. */
const LARGEST = 4 << 20;
/** First bytes of an ELF file of 32 bits, and the type of a segment that is loaded. */
const [ELF, LOAD] = [[0x7f, 0x45, 0x4c, 0x46, 1, 1], 1];
/** First characters and largest length of the version text in each image. */
const [VERSION, LONGEST] = ["HW: 20, Maj: ", 40];

/** Bytes of a file in flash. Those of an ELF file begin at its lowest address; gaps are filled with 0xFF, as erased flash is. */
function flashOf(/** @type {Uint8Array} */ file) {
  if (!ELF.every((byte, index) => file[index] === byte)) return file;
  const view = new DataView(file.buffer);
  const [headers, size, count] = [view.getUint32(28, true), view.getUint16(42, true), view.getUint16(44, true)];
  const segments = Array.from({ length: count }, (_, index) => {
    const [type, from, , at, length] = [0, 4, 8, 12, 16].map((field) => view.getUint32(headers + index * size + field, true));
    return { loaded: type === LOAD && length > 0, at, data: file.subarray(from, from + length) };
  }).filter(({ loaded }) => loaded);
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
  const file = h("input", { type: "file", id: "firmware-file", hidden: true, onchange: async () => {
    const [chosen] = file.files;
    file.value = "";
    if (!chosen) return;
    try {
      const bytes = flashOf(new Uint8Array(await chosen.arrayBuffer()));
      const version = versionOf(bytes);
      for (let offset = 0; offset < bytes.length; offset += PART) {
        const hex = [...bytes.subarray(offset, offset + PART)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
        link.order("firmware", { offset, hex });
      }
      link.order("update", { version });
    } catch (error) {
      say(says, `${chosen.name}: ${/** @type {Error} */ (error).message}.`);
    }
  } });
  const send = h("button", { type: "button", id: "firmware-send", onclick: () => file.click() }, "Send new firmware");

  function allow() {
    send.disabled = running || !(inControl() && state.connected && state.reports);
  }
  on("update", ({ state: is, percent, text }) => {
    running = is === "running";
    progress.value = percent;
    say(says, is === "failed" ? `The update failed: ${text}.` : is === "done" ? `The update is done: ${text}.` : `${text} ${percent} %`);
    allow();
  });
  for (const what of ["control", "open", "line"]) on(what, allow);
  return h("div", { class: "stack" }, h("h3", {}, "New firmware"), says, progress, h("div", { class: "row" }, send, file));
}
