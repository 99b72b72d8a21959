// The socket to the server. It returns the numbers of shown frames, which proves that this page is open: see `desk` in the
// server. After a loss the socket connects again.

/** One of this many frames is acknowledged: ten per second. */
const EVERY = 5;
const AGAIN_MS = 1000;

/** @typedef {{kind: string, [key: string]: any}} Message */

export class Link {
  /** @param {(message: Message) => void} hear @param {(open: boolean) => void} changed */
  constructor(hear, changed) {
    this.hear = hear;
    this.changed = changed;
    document.addEventListener("visibilitychange", () => this.order("hidden", { hidden: document.hidden }));
    this.open();
  }

  open() {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    this.socket = new WebSocket(`ws://${location.host}/ws?token=${encodeURIComponent(token)}`);
    this.socket.onopen = () => this.changed(true);
    this.socket.onmessage = ({ data }) => this.take(data);
    this.socket.onclose = () => {
      this.changed(false);
      setTimeout(() => this.open(), AGAIN_MS);
    };
  }

  /** @param {string} data */
  take(data) {
    const message = JSON.parse(data);
    this.hear(message);
    if (message.kind === "frame" && message.number % EVERY === 0) this.order("shown", { number: message.number });
  }

  /** @param {string} order @param {Record<string, any>|null} [fields] @returns {boolean} true if the order was sent */
  order(order, fields = null) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ [order]: fields }));
    return true;
  }
}
