// Sends texts to the server, and receives texts from the server. The connection is a WebSocket, which connects again
// after a loss. The page without a server has its own version of this file, in host/tab/page.

const AGAIN_MS = 1000;

/** Whether the program that answers here admits this page: `null` if no program answers. @returns {Promise<boolean|null>} */
export const admitted = () => fetch(`/${location.search}`).then(({ ok }) => ok, () => null);

/**
 * Connects to the server.
 * @param {{changed: (open: boolean) => void, take: (text: string) => void}} page
 * @returns {(text: string) => boolean} sends a text; false without a connection
 */
export function connect({ changed, take }) {
  /** @type {WebSocket} */
  let socket;
  const token = new URLSearchParams(location.search).get("token") ?? "";
  function open() {
    socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/ws?token=${encodeURIComponent(token)}`);
    socket.onopen = () => changed(true);
    socket.onmessage = ({ data }) => take(data);
    socket.onclose = () => {
      changed(false);
      setTimeout(open, AGAIN_MS);
    };
  }
  open();
  return (text) => {
    if (socket.readyState !== WebSocket.OPEN) return false;
    socket.send(text);
    return true;
  };
}
