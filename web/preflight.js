// The checks before a start, as `tomoswarm preflight` makes them, asked of the server while they are looked at: those of the moment
// that is shown.

/** @import { Model } from "./model.js" */

const AGAIN_MS = 2000;
const ANSWERED_WITHIN_MS = 4000;
const SHAPES = { go: "✓ go", unknown: "? not known", "no-go": "✖ NO-GO" };

export class PreflightPanel {
  constructor(/** @type {Model} */ model, token) {
    this.model = model;
    this.token = token;
    this.asked_ms = -Infinity;
    /** Of what was asked last: another moment is another board. */
    this.asked = null;
    this.wanted = () => {};
  }

  draw() {
    // The browser's own clock: the one that is shown goes back with the moment.
    const now_ms = performance.now();
    const { generation } = this.model;
    if (this.asked === generation && now_ms - this.asked_ms < AGAIN_MS) return;
    this.asked = generation;
    this.asked_ms = now_ms;
    this.ask(generation);
  }

  async ask(generation) {
    const verdict = document.getElementById("preflight-verdict");
    const page = this.model.place?.page;
    try {
      const headers = { Authorization: `Bearer ${this.token}` };
      const of = page === undefined ? "" : `?page=${page}`;
      const answer = await fetch(`preflight${of}`, { headers, signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
      const text = await answer.text();
      if (this.asked !== generation) return;
      if (!answer.ok) {
        verdict.textContent = text;
        return;
      }
      this.show(JSON.parse(text), verdict);
    } catch {
      verdict.textContent = "The server does not answer.";
    }
  }

  show(checks, verdict) {
    verdict.textContent = checks.isGo ? "✓ GO" : "✖ NO-GO";
    verdict.className = checks.isGo ? "done" : "failed";
    const items = checks.nodes.flatMap(({ node, checks: all }) => {
      const head = document.createElement("li");
      head.className = "node";
      head.textContent = node;
      return [head, ...all.map(line)];
    });
    document.getElementById("preflight-list").replaceChildren(...items);
  }
}

function line({ what, light, found }) {
  const item = document.createElement("li");
  item.className = light;
  item.textContent = `${SHAPES[light] ?? light} ${what}: ${found}`;
  return item;
}
