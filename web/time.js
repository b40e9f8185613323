// Which moment is shown: a bar with marks at troubles, orders, images and where somebody was marked; back, on at any speed, and to what is new.

/** @import { Model } from "./model.js" */

const KINDS = { trouble: { height: 1, of: "--stop" }, order: { height: 0.75, of: "--accent" }, image: { height: 0.5, of: "--good" }, mark: { height: 0.75, of: "--good" } };
/** A moment so near to the end is the end, seconds. */
const NEAR_S = 0.05;
const ANSWERED_WITHIN_MS = 500;

export class TimeBar {
  constructor(/** @type {Model} */ model, feed) {
    this.model = model;
    this.feed = feed;
    this.bar = document.getElementById("time-at");
    this.play = document.getElementById("time-play");
    this.speed = document.getElementById("time-speed");
    this.marks = document.getElementById("time-marks");
    /** The moment that was asked for and is not shown yet. */
    this.asked_s = null;
    /** What is to be asked for when the last has been answered, or has taken too long. */
    this.wanted = null;
    this.askedAt_ms = -Infinity;
    this.bar.addEventListener("input", () => this.goTo(Number(this.bar.value), 0));
    this.play.addEventListener("click", () => this.playOrPause());
    this.speed.addEventListener("change", () => {
      if (this.isPlaying()) this.goTo(this.at_s(), Number(this.speed.value));
    });
    document.getElementById("time-present").addEventListener("click", () => this.goToPresent());
    document.getElementById("time-before").addEventListener("click", () => this.goToMark(-1));
    document.getElementById("time-after").addEventListener("click", () => this.goToMark(1));
    // On a phone speed and marks are folded in.
    const more = document.getElementById("time-more");
    more.addEventListener("click", () => {
      const isOpen = more.getAttribute("aria-expanded") !== "true";
      more.setAttribute("aria-expanded", String(isOpen));
      document.getElementById("time").classList.toggle("open", isOpen);
      this.drawMarks();
    });
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("resize", () => this.drawMarks());
    addEventListener("theme", () => this.drawMarks());
  }

  key(event) {
    const isElsewhere = document.documentElement.dataset.keys === "off" || event.ctrlKey || event.altKey || event.metaKey
      || event.target.matches?.("input:not([type=range]), select, textarea");
    if (isElsewhere) return;
    const acts = { p: () => this.playOrPause(), n: () => this.goToPresent(), "[": () => this.goToMark(-1), "]": () => this.goToMark(1) };
    acts[event.key.toLowerCase()]?.();
  }

  isAsking() {
    return performance.now() < this.askedAt_ms + ANSWERED_WITHIN_MS;
  }

  isPlaying() {
    return (this.model.moment.speed ?? 0) > 0;
  }

  /** The moment that is shown, or was asked for. */
  at_s() {
    return this.asked_s ?? this.model.shown_ms / 1000;
  }

  goTo(at_s, speed) {
    this.asked_s = at_s;
    this.wanted = { at_s, speed };
    this.ask();
    this.show();
  }

  /** A hand that drags asks for more moments than can be shown: one at a time, and always the last. */
  ask() {
    if (!this.wanted) return;
    if (this.isAsking()) {
      const wait_ms = this.askedAt_ms + ANSWERED_WITHIN_MS - performance.now();
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.ask(), wait_ms);
      return;
    }
    this.askedAt_ms = performance.now();
    this.feed.send({ show: { past: this.wanted } });
    this.wanted = null;
  }

  /** A connection begins: what was asked for was asked of the one before. */
  forget() {
    [this.asked_s, this.wanted, this.askedAt_ms] = [null, null, -Infinity];
  }

  goToPresent() {
    this.forget();
    this.feed.send({ show: "present" });
  }

  playOrPause() {
    if (this.model.isPresent()) return this.goTo(this.at_s(), 0);
    const { to_s, from_s } = this.model.moment;
    // At the end of a recording it begins anew.
    const at_s = this.model.place?.showing === "REPLAY" && !this.isPlaying() && to_s - this.at_s() < NEAR_S ? from_s : this.at_s();
    this.goTo(at_s, this.isPlaying() ? 0 : Number(this.speed.value));
  }

  /** Goes to the next mark (1) or to the one before (-1), and says what it is. */
  goToMark(step) {
    const at_s = this.at_s();
    // What is kept of the past may begin after the first marks.
    const kept = this.model.markers.filter((mark) => mark.at_s >= this.model.moment.from_s);
    const marks = kept.filter((mark) => (step > 0 ? mark.at_s > at_s + NEAR_S : mark.at_s < at_s - NEAR_S));
    const mark = step > 0 ? marks[0] : marks.at(-1);
    const said = document.getElementById("time-mark");
    if (!mark) {
      said.textContent = step > 0 ? "no mark after this" : "no mark before this";
      return;
    }
    const whom = mark.vehicles.length ? ` ${mark.vehicles.join(", ")}:` : "";
    said.textContent = `${mark.kind}:${whom} ${mark.text}`;
    this.goTo(mark.at_s, 0);
  }

  /** Shows which moment the model has. */
  show() {
    const { model } = this;
    const { moment } = model;
    const isPresent = model.isPresent();
    if (!isPresent && model.changed.has("moment")) {
      this.askedAt_ms = -Infinity;
      this.ask();
      if (!this.wanted && !this.isAsking()) this.asked_s = null;
    }
    const at_s = isPresent ? moment.to_s : this.at_s();
    const to_s = Math.max(moment.to_s, at_s);
    const isPlaying = this.isPlaying();
    const shown = [model.markers.length, at_s, moment.from_s, to_s, isPresent, isPlaying, model.place?.showing, this.asked_s].join();
    if (shown === this.shownKey) return;
    this.shownKey = shown;
    [this.bar.min, this.bar.max] = [String(moment.from_s), String(to_s)];
    if (document.activeElement !== this.bar || this.asked_s === null) this.bar.value = String(at_s);
    const text = `${clock(at_s - moment.from_s)} of ${clock(to_s - moment.from_s)}`;
    this.bar.setAttribute("aria-valuetext", isPresent ? `now, ${text}` : text);
    document.getElementById("time-text").textContent = text;
    this.play.textContent = isPresent || isPlaying ? "❚❚ Pause" : "▶ Play";
    document.getElementById("time-present").disabled = isPresent;
    document.getElementById("time-present").textContent = model.place?.showing === "REPLAY" ? "End (N)" : "Now (N)";
    const key = `${model.markers.length} ${moment.from_s} ${to_s}`;
    if (key !== this.drawnKey) this.drawMarks();
    this.drawnKey = key;
  }

  drawMarks() {
    const { marks, model } = this;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [marks.clientWidth, marks.clientHeight];
    [marks.width, marks.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const pen = marks.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const { from_s, to_s } = model.moment;
    const style = getComputedStyle(marks);
    for (const mark of model.markers) {
      const { height: share, of } = KINDS[mark.kind] ?? KINDS.order;
      if (mark.at_s < from_s) continue;
      const x = ((mark.at_s - from_s) / Math.max(to_s - from_s, 1e-3)) * (width - 2);
      pen.fillStyle = style.getPropertyValue(of);
      pen.fillRect(x, height * (1 - share), 2, height * share);
    }
  }
}

/** A time as minutes and seconds. */
export function clock(time_s) {
  const whole_s = Math.max(0, Math.floor(time_s));
  return `${Math.floor(whole_s / 60)}:${String(whole_s % 60).padStart(2, "0")}`;
}
