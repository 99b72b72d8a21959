// Messages and orders. The page returns the numbers of painted frames, which proves that somebody can see this page: see the
// server's module about who is in control.

import { connect } from "./transport.js";

/** Shortest interval between two acknowledgements, in milliseconds: some ten per second, also where few frames are painted. */
const EVERY_MS = 90;
/** Longest order in bytes: the server breaks a connection with a longer one. */
const LONGEST = 16 * 1024;

/** @typedef {{kind: string, [key: string]: any}} Message */

export class Link {
  /** @param {(message: Message) => void} onMessage @param {(open: boolean) => void} changed */
  constructor(onMessage, changed) {
    this.onMessage = onMessage;
    document.addEventListener("visibilitychange", () => this.hide());
    /** Numbers of frames: the newest, the newest that the page held when it was painted last, and the newest acknowledged. */
    [this.newest, this.held, this.acknowledged] = [0, 0, 0];
    this.acknowledgedAt = 0;
    this.send = connect({
      changed: (open) => {
        if (open) [this.newest, this.held, this.acknowledged] = [0, 0, 0];
        changed(open);
      },
      take: (text) => this.take(text),
    });
    this.paint();
  }

  /** @param {string} text */
  take(text) {
    const message = JSON.parse(text);
    // The server counts a page that has just connected as visible.
    if (message.kind === "welcome" && document.hidden) this.hide();
    this.onMessage(message);
    if (message.kind === "frame") this.newest = message.number;
    // After a message about the line no frame comes, with which a hidden page could acknowledge the newest one.
    else if (message.kind === "line") this.acknowledgedAt = 0;
    // A hidden page is not painted. The server allows that for some seconds.
    if (document.hidden) this.acknowledge(this.newest);
  }

  hide() {
    this.order("hidden", { hidden: document.hidden });
  }

  /** Runs before each painting: what the page held at the last call has been painted since. */
  paint() {
    this.acknowledge(this.held);
    this.held = this.newest;
    requestAnimationFrame(() => this.paint());
  }

  /** @param {number} number */
  acknowledge(number) {
    const now = performance.now();
    if (number <= this.acknowledged || now - this.acknowledgedAt < EVERY_MS || !this.order("shown", { number })) return;
    [this.acknowledged, this.acknowledgedAt] = [number, now];
  }

  /** @param {string} order @param {any} [fields] @returns {boolean} true if the order was sent */
  order(order, fields = null) {
    const text = JSON.stringify({ [order]: fields });
    const { length } = new TextEncoder().encode(text);
    if (length <= LONGEST) return this.send(text);
    // Only a file makes an order so long.
    this.onMessage({ kind: "refused", why: `the file is too long: with it the order has ${length} bytes; allowed are at most ${LONGEST}. Check that it is the right file` });
    return false;
  }
}
