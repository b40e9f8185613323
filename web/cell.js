// Who has seen a cell of the map, what each says of it, and since when: of the cell where the pointer rests or taps, or, by a key, of
// that in the middle of what is seen. Asked from the server, which knows the layers; also of an earlier moment.

const RESTS_MS = 200;
/** What is shown is asked for again this often: vehicles go on. */
const AGAIN_MS = 1000;
const NONE = "No vehicle says anything of it.";

export class CellView {
  constructor(model, plane, view, token) {
    Object.assign(this, { model, plane, view, token });
    this.box = document.getElementById("cell");
    /** The place that is asked about; by the key it is the middle, wherever that is. */
    this.at = null;
    this.isMiddle = false;
    this.asked = 0;
    plane.hovered = (at) => this.hover(at);
    plane.moved = () => this.follow();
    view.hovered = (at) => this.hover(at);
    addEventListener("keydown", (event) => this.key(event));
    setInterval(() => { if (this.at && !document.hidden) this.ask(); }, AGAIN_MS);
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
    const [x, y] = this.at;
    const { slice } = this.plane.map;
    const page = this.model.place?.page;
    const of = [`x=${x.toFixed(3)}`, `y=${y.toFixed(3)}`, ...(slice === null ? [] : [`slice=${slice}`]), ...(page ? [`page=${page}`] : [])];
    let said = null;
    try {
      const answer = await fetch(`cell?${of.join("&")}`, { headers: { Authorization: `Bearer ${this.token}` } });
      if (answer.ok) said = await answer.json();
    } catch {
      // What is not answered is not shown; the head says that there is no connection.
    }
    // Meanwhile something else was pointed at.
    if (asked !== this.asked || !this.at) return;
    if (said) this.show(said, slice);
  }

  show({ at, told, leftOut, at_s }, slice) {
    const { map } = this.plane;
    const [x, y] = at.map((metres) => metres.toFixed(2));
    const isAll = slice === null && map.known().length > 1;
    const rows = told.map((row) => {
      const share = Math.round(100 / (1 + Math.exp(-row.logOdds)));
      const where = isAll ? `, ${map.name(row.slice)}` : "";
      const time = this.model.timeText((at_s - row.age_s) * 1000);
      const when = `${ageText(row.age_s)} ago${row.mayBeOlder ? " or earlier" : ""} (${time})`;
      return item("li", `vehicle ${row.vehicle} (start ${row.boot})${where}: ${row.says} (occupied with ${share} %); its tile changed ${when}`);
    });
    if (leftOut > 0) rows.push(item("li", `and ${leftOut} that changed earlier`));
    const list = document.createElement("ul");
    list.append(...rows);
    const head = `cell x ${x}, y ${y} m: ${this.plane.cellWord(at[0], at[1])}`;
    const shown = [head, ...rows.map((row) => row.textContent)].join("\n");
    this.box.hidden = false;
    // A reader of screens is told what is new, not everything once a second.
    if (shown !== this.shown || this.box.childElementCount === 0) this.box.replaceChildren(item("strong", head), rows.length ? list : item("p", NONE));
    this.shown = shown;
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

function item(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}
