// Sends texts to the relay, and receives texts from the relay. The relay runs in this tab: see the package `tab`. This
// file replaces the dashboard's file of the same name.

import { elementById, h } from "./dom.js";

/** The shortest interval between two frames, in milliseconds; screens paint every 16.7 ms or faster. */
const FRAME_MS = 15;
/** Time without a painting after which the page gives up control, in milliseconds. */
const SILENCE_MS = 1000;
/** Speed of a hub's serial line. */
const BAUD = 460800;

/** Always `null`: there is no server that must admit this page. */
export const admitted = async () => null;

/** The open serial port: arrived bytes, a function that wakes their reader, and one that sends bytes; else `null`. */
let port = /** @type {{arrived: number[], wake: () => void, write: (bytes: Uint8Array) => void}|null} */ (null);

/** Reads a serial port until it is closed, and returns why it was closed. */
async function read(/** @type {any} */ opened) {
  const writer = opened.writable.getWriter();
  const own = (port = { arrived: [], wake: () => {}, write: (bytes) => { writer.write(bytes).catch(() => {}); } });
  try {
    const reader = opened.readable.getReader();
    for (;;) {
      const { value, done } = await reader.read();
      if (done) break;
      own.arrived.push(...value);
      own.wake();
    }
  } catch {
    // The port was unplugged. The relay then reports that the port is closed.
  }
  if (port === own) port = null;
  own.wake();
}

/** Waits for bytes, and takes at most `length` of them; `null` if the port is closed. */
async function take(/** @type {number} */ length, /** @type {number} */ wait) {
  if (port && !port.arrived.length) {
    const { wake, slept } = sleeper(wait);
    port.wake = wake;
    await slept;
  }
  return port && port.arrived.splice(0, length);
}

function sleeper(/** @type {number} */ wait) {
  let wake = () => {};
  const slept = /** @type {Promise<void>} */ (new Promise((done) => { wake = done; setTimeout(done, wait); }));
  return { wake, slept };
}

/** @param {{changed: (open: boolean) => void, take: (text: string) => void}} page @returns {(text: string) => boolean} */
export function connect(page) {
  /** @type {any} */
  let relay = null;
  /** The last call of the relay. A call begins when the one before has returned. */
  let calls = Promise.resolve();
  const bytes = (/** @type {number} */ at, /** @type {number} */ length) => new Uint8Array(relay.memory.buffer, at, length);
  const waits = "Suspending" in WebAssembly;
  const { Suspending, promising } = /** @type {any} */ (WebAssembly);
  const call = (/** @type {() => any} */ act) => (calls = calls.then(act).catch((error) => {
    page.changed(false);
    throw error;
  }));

  async function receive(/** @type {number} */ at, /** @type {number} */ length, /** @type {number} */ wait) {
    const arrived = await take(length, wait);
    if (!arrived) return -1;
    bytes(at, arrived.length).set(arrived);
    return arrived.length;
  }
  const imports = {
    now_ms: () => performance.now(),
    tell: (/** @type {number} */ at, /** @type {number} */ length) => page.take(new TextDecoder().decode(bytes(at, length))),
    receive: waits ? new Suspending(receive) : () => -1,
    send: (/** @type {number} */ at, /** @type {number} */ length) => {
      port?.write(bytes(at, length).slice());
      return port ? length : -1;
    },
  };

  async function load() {
    const packed = Uint8Array.from(atob(elementById("relay").textContent), (letter) => letter.charCodeAt(0));
    const code = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
    const { instance } = await WebAssembly.instantiate(code, { page: imports });
    const { memory, input, ...functions } = instance.exports;
    relay = { memory, input };
    for (const name of ["start", "order", "tick"]) relay[name] = waits ? promising(functions[name]) : functions[name];
    await begin(false);
  }

  /** Starts with the simulated hub, or with the hub on the serial port. */
  const begin = (/** @type {boolean} */ serial) => {
    page.changed(true);
    return call(() => relay.start(serial));
  };

  let [last, painted] = [0, 0];
  let ticks = false;
  /** A tick before each painting: a tab that is hidden or closed sends nothing to its hub, which disables the motors. */
  function paint(/** @type {number} */ now) {
    // The page in control must show new values at least every second.
    if (relay && painted && now - painted > SILENCE_MS) send(JSON.stringify({ release: null }));
    painted = now;
    if (relay && !ticks && now - last >= FRAME_MS) {
      [last, ticks] = [now, true];
      call(() => relay.tick()).then(() => { ticks = false; }, () => {});
    }
    requestAnimationFrame(paint);
  }

  const browser = /** @type {any} */ (navigator);
  const button = h("button", { type: "button", id: "serial", title: "A hub on a serial port of this computer, such as the USB of a NUCLEO board", disabled: !(browser.serial && waits), onclick: async () => {
    if (port) return location.reload();
    // The user may choose no port.
    const chosen = await browser.serial.requestPort().catch(() => null);
    if (!chosen) return;
    try {
      await chosen.open({ baudRate: BAUD });
    } catch (error) {
      return page.take(JSON.stringify({ kind: "refused", why: `the serial port cannot be opened: ${/** @type {Error} */ (error).message} Close the program that uses it, and try again` }));
    }
    button.textContent = "Simulate";
    // Unplugged, the hub can be connected again.
    read(chosen).then(() => { button.textContent = "Connect a hub"; });
    await begin(true);
  } }, "Connect a hub");
  if (button.disabled) button.title = "A hub on a serial port needs Chromium, Chrome or Edge, 137 or later";
  elementById("units").before(button);

  const send = (/** @type {string} */ text) => {
    if (!relay) return false;
    call(() => {
      const order = new TextEncoder().encode(text);
      bytes(relay.input(order.length), order.length).set(order);
      return relay.order();
    });
    return true;
  };
  load();
  requestAnimationFrame(paint);
  return send;
}
