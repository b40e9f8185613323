// The connection to the server: frames come, and credit goes back when they were drawn. Opens itself anew.

const AGAIN_MS = 1000;

export class Feed {
  /** `take` is given each frame; `changed` is told when the connection comes and goes. */
  constructor(token, take, changed) {
    this.token = token;
    this.take = take;
    this.changed = changed;
    this.undrawn = 0;
    this.why = "";
    this.isOpen = false;
    this.connect();
  }

  connect() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/feed`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.undrawn = 0;
      this.isOpen = true;
      socket.send(JSON.stringify({ token: this.token }));
      this.changed();
    };
    socket.onmessage = (event) => {
      this.undrawn += 1;
      this.take(event.data);
    };
    socket.onclose = (event) => {
      this.isOpen = false;
      this.why = event.reason;
      this.changed();
      // A strange token stays strange.
      if (event.code !== 1008) setTimeout(() => this.connect(), AGAIN_MS);
    };
    this.socket = socket;
  }

  /** Says something to the server, if there is a connection. */
  send(words) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(words));
  }

  /** Gives credit for what was drawn. */
  drawn() {
    if (this.undrawn === 0 || this.socket.readyState !== WebSocket.OPEN) return;
    this.send({ credit: this.undrawn });
    this.undrawn = 0;
  }
}
