// The checks before a start, as `tomoswarm preflight` makes them, asked of the server while they are looked at.

const AGAIN_MS = 2000;
const SHAPES = { go: "✓ go", unknown: "? not known", "no-go": "✖ NO-GO" };

export class PreflightPanel {
  constructor(token) {
    this.token = token;
    this.asked_ms = -Infinity;
  }

  draw() {
    // The browser's own clock: the one that is shown goes back with the moment.
    const now_ms = performance.now();
    if (now_ms - this.asked_ms < AGAIN_MS) return;
    this.asked_ms = now_ms;
    this.ask();
  }

  async ask() {
    const verdict = document.getElementById("preflight-verdict");
    try {
      const answer = await fetch("preflight", { headers: { Authorization: `Bearer ${this.token}` } });
      const text = await answer.text();
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
