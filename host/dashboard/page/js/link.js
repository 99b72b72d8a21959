// The socket to the server. It returns the numbers of painted frames, which proves that somebody can see this page: see the
// server's module about who is in control. After a loss the socket connects again.

/** One of this many frames is acknowledged: ten per second. */
const EVERY = 5;
const AGAIN_MS = 1000;

/** Whether the program that answers here admits this page: `null` if no program answers. @returns {Promise<boolean|null>} */
export const admitted = () => fetch(`/${location.search}`).then(({ ok }) => ok, () => null);

/** @typedef {{kind: string, [key: string]: any}} Message */

export class Link {
  /** @param {(message: Message) => void} hear @param {(open: boolean) => void} changed */
  constructor(hear, changed) {
    this.hear = hear;
    this.changed = changed;
    document.addEventListener("visibilitychange", () => this.order("hidden", { hidden: document.hidden }));
    /** Numbers of frames: the newest, the newest that the page held when it was painted last, and the newest acknowledged. */
    [this.newest, this.held, this.acknowledged] = [0, 0, 0];
    this.open();
    this.paint();
  }

  open() {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    this.socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/ws?token=${encodeURIComponent(token)}`);
    this.socket.onopen = () => {
      [this.newest, this.held, this.acknowledged] = [0, 0, 0];
      this.changed(true);
    };
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
    if (message.kind !== "frame") return;
    this.newest = message.number;
    // A hidden page is not painted. The server allows that for some seconds.
    if (document.hidden) this.acknowledge(message.number);
  }

  /** Runs before each painting: what the page held at the last call has been painted since. */
  paint() {
    this.acknowledge(this.held);
    this.held = this.newest;
    requestAnimationFrame(() => this.paint());
  }

  /** @param {number} number */
  acknowledge(number) {
    if (number >= this.acknowledged + EVERY && this.order("shown", { number })) this.acknowledged = number;
  }

  /** @param {string} order @param {Record<string, any>|null} [fields] @returns {boolean} true if the order was sent */
  order(order, fields = null) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ [order]: fields }));
    return true;
  }
}
