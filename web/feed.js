// The connection to the server: frames come, and credit goes back when they were drawn. Opens itself anew, also when nothing comes
// of it any more: a page that has drawn all is told every second that the server lives.

const AGAIN_MS = 1000;
const LOOKS_EVERY_MS = 1000;
/** A connection of which nothing has come for so long is dead. */
const DEAD_AFTER_MS = 10000;
/** A policy is violated: a strange token stays strange. */
const CLOSED_FOR_GOOD = 1008;

export class Feed {
  /** `take` is given each frame; `changed` is told when the connection comes and goes. */
  constructor(token, secret, take, changed) {
    this.token = token;
    this.secret = secret;
    this.take = take;
    this.changed = changed;
    this.undrawn = 0;
    this.why = "";
    this.isOpen = false;
    this.isOver = false;
    /** The vehicle that is ridden with; null = none. */
    this.ridden = null;
    this.heard_ms = 0;
    this.connect();
    setInterval(() => this.look(), LOOKS_EVERY_MS);
  }

  connect() {
    this.heard_ms = performance.now();
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/feed`);
    socket.binaryType = "arraybuffer";
    this.undrawn = 0;
    socket.onopen = () => {
      this.isOpen = true;
      socket.send(JSON.stringify({ token: this.token, secret: this.secret }));
      if (this.ridden !== null) this.send({ ride: this.ridden });
      this.changed();
    };
    socket.onmessage = (event) => {
      this.undrawn += 1;
      this.heard_ms = performance.now();
      this.take(event.data);
    };
    socket.onclose = (event) => {
      this.isOver = event.code === CLOSED_FOR_GOOD;
      this.lose(event.reason);
      if (!this.isOver) setTimeout(() => this.connect(), AGAIN_MS);
    };
    this.socket = socket;
  }

  lose(why) {
    this.isOpen = false;
    this.why = why;
    this.changed();
  }

  /** Gives a connection up that is dead without having been closed. What waits to be drawn keeps the server waiting. */
  look() {
    const now_ms = performance.now();
    if (document.hidden || this.undrawn > 0) this.heard_ms = now_ms;
    if (this.isOver || this.socket.readyState > WebSocket.OPEN || now_ms - this.heard_ms < DEAD_AFTER_MS) return;
    const { socket } = this;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
    this.lose("nothing comes");
    this.connect();
  }

  /** Says something to the server, if there is a connection. */
  send(words) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(words));
  }

  /** Asks for what the range sensors of a vehicle hear, as long as it is ridden with. */
  ride(vehicle) {
    if (this.ridden === vehicle) return;
    this.ridden = vehicle;
    this.send({ ride: vehicle ?? 0 });
  }

  /** Gives credit for what was drawn. */
  drawn() {
    if (this.undrawn === 0 || this.socket.readyState !== WebSocket.OPEN) return;
    this.send({ credit: this.undrawn });
    this.undrawn = 0;
  }
}
