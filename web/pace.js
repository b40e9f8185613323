// What keeps drawing cheap: how often something is drawn of which new data comes faster than anybody reads, and texts that are
// written only when they have changed. And how long an answer is waited for.

/** A question without an answer is given up after this time: it keeps one of the few connections that Stop needs. */
export const ANSWERED_WITHIN_MS = 10_000;

export class Pace {
  /** `again` is told when what was put off is due. */
  constructor(every_ms, again) {
    this.every_ms = every_ms;
    this.again = again;
    this.drawn_ms = -Infinity;
    this.timer = 0;
  }

  /** Whether it may be drawn now; if not, `again` is told as soon as it may. */
  isDue() {
    const left_ms = this.drawn_ms + this.every_ms - performance.now();
    if (left_ms <= 0) return true;
    if (this.timer === 0) this.timer = setTimeout(() => { this.timer = 0; this.again(); }, left_ms);
    return false;
  }

  /** It was drawn. */
  drawn() {
    clearTimeout(this.timer);
    [this.timer, this.drawn_ms] = [0, performance.now()];
  }
}

/** Shows a text; one that is shown already costs nothing. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
