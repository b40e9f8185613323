// Who has seen a cell of the map, what each says of it, and since when: of the cell where the pointer rests or taps, or, by a key, of
// that in the middle of what is seen. Asked from the server, which knows the layers; also of an earlier moment. Of a live swarm the
// page shows the command, by which each vehicle's tiles are listened to.

/** @import { Model } from "./model.js" */
/** @import { ToldCell } from "./told" */

const RESTS_MS = 200;
/** What is shown is asked for again this often: vehicles go on. */
const AGAIN_MS = 1000;
/** What is not answered within this time is not answered. */
const ANSWERED_WITHIN_MS = 5000;
const NONE = "No vehicle says anything of it.";
/** What says the same in a terminal, as it changes: each tile as its vehicle says it. */
const COMMAND = "tomoswarm tap CONFIG --kind tile --cells";

export class CellView {
  constructor(/** @type {Model} */ model, plane, view, token) {
    this.model = model;
    this.plane = plane;
    this.view = view;
    this.token = token;
    this.box = document.getElementById("cell");
    /** The place that is asked about; by the key it is the middle, wherever that is. */
    this.at = null;
    this.isMiddle = false;
    this.asked = 0;
    this.isAsking = false;
    plane.hovered = (at) => this.hover(at);
    plane.moved = () => this.follow();
    view.hovered = (at) => this.hover(at);
    addEventListener("keydown", (event) => this.key(event));
    setInterval(() => this.again(), AGAIN_MS);
  }

  key(event) {
    const isOff = document.documentElement.dataset.keys === "off" || event.target.matches?.("input, select, textarea");
    if (isOff || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "Escape" && this.at) this.look(null);
    if (event.key.toLowerCase() !== "c") return;
    event.preventDefault();
    this.isMiddle = !(this.isMiddle && this.at);
    this.look(this.isMiddle ? this.view.middle() : null);
  }

  hover(at) {
    clearTimeout(this.timer);
    if (this.isMiddle) return;
    if (at === null) this.look(null);
    else this.timer = setTimeout(() => this.look(at), RESTS_MS);
  }

  /** What is seen has moved: the middle is another one. */
  follow() {
    if (!this.isMiddle) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.look(this.view.middle()), RESTS_MS);
  }

  /** Asks again, but never while an answer is awaited: a slow one would be passed over for the next. */
  again() {
    if (!this.at || this.isAsking || document.hidden) return;
    // Also who rides sees another middle.
    this.look(this.isMiddle ? this.view.middle() : this.at);
  }

  look(at) {
    this.at = at;
    if (at) return this.ask();
    this.isMiddle = false;
    this.plane.cell = null;
    this.box.hidden = true;
    this.plane.wanted();
  }

  async ask() {
    const asked = ++this.asked;
    this.isAsking = true;
    const [x, y] = this.at;
    const { slice } = this.plane.map;
    const page = this.model.place?.page;
    const of = [`x=${x.toFixed(3)}`, `y=${y.toFixed(3)}`, ...(slice === null ? [] : [`slice=${slice}`]), ...(page ? [`page=${page}`] : [])];
    let said = null;
    try {
      const headers = { Authorization: `Bearer ${this.token}` };
      const answer = await fetch(`cell?${of.join("&")}`, { headers, signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
      if (answer.ok) said = await answer.json();
    } catch {
      // That there is no answer is shown below.
    }
    // Meanwhile something else was pointed at.
    if (asked !== this.asked) return;
    this.isAsking = false;
    if (!this.at) return;
    if (said) return this.show(said, slice);
    this.write(`x ${x.toFixed(2)}, y ${y.toFixed(2)} m`, [], "The server gives no answer.");
    this.mark(null);
  }

  show(/** @type {ToldCell} */ { at, told, leftOut, at_s }, slice) {
    const { map } = this.plane;
    const [x, y] = at.map((metres) => metres.toFixed(2));
    const isAll = slice === null && map.known().length > 1;
    const rows = told.map((row) => {
      const share = Math.round(100 / (1 + Math.exp(-row.logOdds)));
      const where = isAll ? `, ${map.name(row.slice)}` : "";
      const time = this.model.timeText((at_s - row.age_s) * 1000);
      const when = `${ageText(row.age_s)} ago${row.mayBeOlder ? " or earlier" : ""} (${time})`;
      const text = `vehicle ${row.vehicle} (start ${row.boot})${where}: ${row.says} (occupied with ${share} %)`;
      return { text, age: `; its tile changed ${when}` };
    });
    if (leftOut > 0) rows.push({ text: `and ${leftOut} that changed earlier`, age: "" });
    this.write(`cell x ${x}, y ${y} m: ${this.plane.cellWord(at[0], at[1])}`, rows, NONE);
    this.mark(at);
  }

  /**
   * Fills the box with a head and rows, or with another text if there are no rows. A reader of screens is told what is new, not
   * everything once a second: ages are hidden from it, and where nothing but ages has changed, only they are written.
   */
  write(head, rows, none) {
    const texts = rows.length ? rows.map(({ text }) => text) : [none];
    const isNow = this.model.isLive() && this.model.isPresent();
    const shown = [head, ...texts, isNow].join("\n");
    if (shown !== this.shown) {
      const list = document.createElement("ul");
      list.append(...texts.map(line));
      this.box.replaceChildren(item("strong", head), rows.length ? list : item("p", none), ...(isNow ? [asCommand()] : []));
    }
    this.shown = shown;
    const ages = this.box.querySelectorAll("[aria-hidden]");
    rows.forEach(({ age }, index) => { ages[index].textContent = age; });
    this.box.hidden = false;
  }

  /** Marks the cell in the scene; null = none. */
  mark(at) {
    if (JSON.stringify(this.plane.cell) === JSON.stringify(at)) return;
    this.plane.cell = at;
    this.plane.wanted();
  }
}

function ageText(age_s) {
  if (age_s < 10) return `${age_s.toFixed(1)} s`;
  if (age_s < 120) return `${age_s.toFixed(0)} s`;
  return `${(age_s / 60).toFixed(0)} min`;
}

/** A row, with room for its age. */
function line(text) {
  const made = item("li", text);
  const age = document.createElement("span");
  age.setAttribute("aria-hidden", "true");
  made.append(age);
  return made;
}

function asCommand() {
  const made = item("p", "As a command: ");
  made.append(item("code", COMMAND));
  return made;
}

function item(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}
