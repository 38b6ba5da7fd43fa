// The WebSocket: reconnects as needed; acknowledges each picture once it has been drawn.

const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 5000;
const SILENT_MS = 2500; // the server speaks once a second at least; as a state holds for so long (topics.py)
const WATCH_MS = 250;
const MADE_ROOM = 4001; // close codes of the server's own: this page was idle, and another needed its place;
const FULL = 4002; // there is no place

export class Link {
  /** hear: {status, trace, picture, fit, connection}, each called with what was received. */
  constructor(hear) {
    this.hear = hear;
    this.pause = FIRST_PAUSE_MS;
    this.waiting = new Map();
    this.next = 1;
    this.look = null;
    this.heardAt = performance.now();
    this.connect();
    setInterval(() => this.watch(), WATCH_MS);
  }

  /** A server that hangs, or a cable that is pulled, closes no connection: silence tells. */
  watch() {
    if (!this.socket.onclose || performance.now() - this.heardAt < SILENT_MS) return;
    this.heardAt = performance.now();
    this.lose(this.socket);
  }

  lose(socket, code = 0, reason = "") {
    if (socket !== this.socket || !socket.onclose) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
    for (const { reject } of this.waiting.values()) reject(new Error("The connection to the server was lost before it answered."));
    this.waiting.clear();
    this.hear.connection(false, [MADE_ROOM, FULL].includes(code) ? reason : "");
    if (code === MADE_ROOM) return;
    setTimeout(() => this.connect(), this.pause);
    this.pause = Math.min(2 * this.pause, LONGEST_PAUSE_MS);
  }

  connect() {
    const address = new URL("live", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heardAt = performance.now();
    socket.onopen = () => {
      if (this.look) socket.send(this.look);
    };
    socket.onmessage = (event) => {
      this.heardAt = performance.now();
      this.take(socket, event.data);
    };
    socket.onclose = (event) => this.lose(socket, event.code, event.reason);
  }

  async take(socket, data) {
    if (typeof data !== "string") {
      try {
        await this.hear.picture(...(await unpack(data)));
      } finally {
        if (socket.readyState === WebSocket.OPEN) socket.send('{"type":"shown"}');
      }
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "status") {
      // Only now: a server without a place for this page opens the connection to say so.
      this.pause = FIRST_PAUSE_MS;
      this.hear.connection(true);
      this.hear.status(message);
    } else if (message.type === "fit") this.hear.fit(message);
    else if (message.type === "trace") this.hear.trace(message.points);
    else if (message.type === "answer") {
      const { resolve, reject } = this.waiting.get(message.id) ?? {};
      this.waiting.delete(message.id);
      if (message.done) resolve?.(message);
      else reject?.(new Error(message.text));
    } else if (message.type === "refused") console.error(message.text);
  }

  /** Tell the server what this page wants to see; repeated after each new connection. */
  want(view, windows) {
    this.look = JSON.stringify({ type: "look", view, ...windows });
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(this.look);
  }

  /** Ask for the ellipse through the clicks of a plane. */
  fit(plane, points) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ type: "fit", plane, points }));
  }

  /** Send a command; the promise resolves to the server's answer {text, file?, name?}, or rejects with its reason. */
  ask(type, body = {}) {
    return new Promise((resolve, reject) => {
      if (this.socket.readyState !== WebSocket.OPEN) {
        reject(new Error("Not sent: there is no connection to the server."));
        return;
      }
      const id = this.next++;
      this.waiting.set(id, { resolve, reject });
      this.socket.send(JSON.stringify({ ...body, type, id }));
    });
  }
}

/** Header and, by plane, bitmap of a binary message. */
async function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let offset = 4 + length;
  const bitmaps = {};
  for (const plane of ["a", "b"]) {
    const described = header.planes[plane];
    if (!described) continue;
    const file = new Blob([new Uint8Array(buffer, offset, described.bytes)], { type: `image/${described.kind}` });
    offset += described.bytes;
    bitmaps[plane] = createImageBitmap(file);
  }
  for (const plane of Object.keys(bitmaps)) bitmaps[plane] = await bitmaps[plane];
  return [header, bitmaps];
}
