// Who hears whom: a matrix of receivers (rows) and transmitters (columns), and the last strengths of one pair in both directions.

/** @import { Model } from "./model.js" */

/** A pair without a sample for so long is old. */
const OLD_AFTER_MS = 5000;
/** Strengths further apart than this are not joined by a line. */
const GAP_MS = 5000;
/** What a cell says: its number, its unit, and how bad it is from 0 to 1. */
const PLANES = {
  rssi: { unit: "dBm", of: (pair) => pair.rssi, bad: (value) => (-50 - value) / 45 },
  loss: { unit: "% missed in 5 s", of: (pair) => Math.round(pair.loss * 100), bad: (value) => value / 60 },
  excess: { unit: "dB weaker than the path loss of all pairs", of: (pair) => pair.excess, bad: (value) => value / 20 },
  asymmetry: { unit: "dB stronger than the other way", of: (pair, other) => (pair.rssi === null || !other || other.rssi === null ? null : pair.rssi - other.rssi), bad: (value) => Math.abs(value) / 12 },
  age: { unit: "s since the last sample came", of: (pair, _other, now_ms) => Math.round((now_ms - pair.at_ms) / 1000), bad: (value) => value / 20 },
};

/** What is not answered within this time is asked for again. */
const ANSWERED_WITHIN_MS = 5000;

export class RadioPanel {
  constructor(/** @type {Model} */ model, token) {
    this.model = model;
    this.token = token;
    this.chosen = null;
    /** Of which pair, and of which board, the server was asked how strongly it was heard before. */
    this.askedOf = null;
    this.isAsking = false;
    this.asksFrom_ms = 0;
    document.addEventListener("visibilitychange", () => { this.askedOf = null; });
    this.wanted = () => {};
    document.getElementById("radio-plane").addEventListener("change", () => this.wanted());
  }

  draw(now_ms) {
    const { pairs } = this.model;
    const said = [...this.model.vehicles.values()].flatMap(({ id, health }) => (health?.hears.length ? [id, ...health.hears] : []));
    const ids = [...new Set([...pairs.values()].flatMap((pair) => [pair.receiver, pair.transmitter]).concat(said))].sort((a, b) => a - b);
    const plane = PLANES[document.getElementById("radio-plane").value];
    document.getElementById("radio-unit").textContent = ids.length === 0
      ? "No samples yet: vehicles send them to the ground station while they measure."
      : `${plane.unit}. Rows hear columns; grey: no sample for 5 s; heard: by the vehicle's own word, no sample has come.`;
    this.layOut(ids);
    for (const receiver of ids) {
      for (const transmitter of ids) if (receiver !== transmitter) this.show(receiver, transmitter, plane, now_ms);
    }
    this.ask();
    this.drawHistory(now_ms);
  }

  /**
   * Asks how strongly the chosen pair was heard before: when it is chosen, when another moment is shown, and when the page was
   * hidden; never while an answer is awaited, and not soon after there was none.
   */
  async ask() {
    const { generation, place } = this.model;
    const wanted = this.chosen && place ? `${generation}/${this.chosen}` : null;
    if (!wanted || wanted === this.askedOf || this.isAsking || performance.now() < this.asksFrom_ms) return;
    const pair = this.chosen;
    [this.askedOf, this.isAsking] = [wanted, true];
    try {
      const headers = { Authorization: `Bearer ${this.token}` };
      const of = `pair?one=${pair[0]}&other=${pair[1]}&page=${place.page}`;
      const answer = await fetch(of, { headers, signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
      if (!answer.ok) throw new Error(answer.statusText);
      const said = await answer.json();
      if (generation === this.model.generation) this.model.takePairHistory(pair, said, performance.now());
    } catch {
      // What the page has heard itself is shown.
      [this.askedOf, this.asksFrom_ms] = [null, performance.now() + ANSWERED_WITHIN_MS];
    }
    this.isAsking = false;
    this.wanted();
  }

  /** Makes the cells anew when there is another vehicle. */
  layOut(ids) {
    if (this.laidOut === ids.join()) return;
    this.laidOut = ids.join();
    this.cells = new Map();
    const head = document.createElement("tr");
    head.append(cell("th", "hears"), ...ids.map((id) => cell("th", String(id), "col")));
    const rows = ids.map((receiver) => {
      const row = document.createElement("tr");
      row.append(cell("th", String(receiver), "row"));
      for (const transmitter of ids) row.append(this.makeCell(receiver, transmitter));
      return row;
    });
    document.getElementById("radio-matrix").replaceChildren(head, ...rows);
  }

  makeCell(receiver, transmitter) {
    const box = document.createElement("td");
    if (receiver === transmitter) return box;
    const button = document.createElement("button");
    button.type = "button";
    button.addEventListener("click", () => {
      this.chosen = [receiver, transmitter];
      this.wanted();
    });
    box.append(button);
    this.cells.set(`${receiver}-${transmitter}`, button);
    return box;
  }

  show(receiver, transmitter, plane, now_ms) {
    const button = this.cells.get(`${receiver}-${transmitter}`);
    const pair = this.model.pairs.get(`${receiver}-${transmitter}`);
    const value = pair ? plane.of(pair, this.model.pairs.get(`${transmitter}-${receiver}`), now_ms) : null;
    const { health } = this.model.vehicles.get(receiver) ?? {};
    const isSaid = health?.hears.includes(transmitter) === true && !this.model.isSilent(receiver, now_ms);
    const text = value !== null ? String(value) : isSaid ? "heard" : "–";
    if (button.textContent !== text) button.textContent = text;
    const isOld = pair ? now_ms - pair.at_ms > OLD_AFTER_MS : !isSaid;
    button.classList.toggle("old", isOld);
    const bad = value === null ? 0 : Math.round(Math.min(1, Math.max(0, plane.bad(value))) * 4);
    button.dataset.bad = String(bad);
    const known = value === null ? "nothing known" : `${value} ${plane.unit}`;
    const said = isSaid ? `${value === null ? "yes" : known}, by its own word` : known;
    button.setAttribute("aria-label", `${receiver} hears ${transmitter}: ${said}${isOld ? ", old" : ""}`);
    button.setAttribute("aria-pressed", String(this.chosen?.[0] === receiver && this.chosen?.[1] === transmitter));
  }

  drawHistory(now_ms) {
    const canvas = document.getElementById("pair-history");
    const caption = document.getElementById("pair-caption");
    canvas.hidden = !this.chosen;
    if (!this.chosen) {
      caption.textContent = "Choose a pair to see how strongly it was heard in the last minutes.";
      return;
    }
    const [one, other] = this.chosen;
    const [width, height] = [Math.max(200, canvas.parentElement.clientWidth - 24), 130];
    [canvas.width, canvas.height] = [width, height];
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(canvas);
    const ways = [[one, other, []], [other, one, [5, 4]]];
    const series = ways.map(([to, from]) => this.model.history.get(`${to}-${from}`) ?? []);
    const all = series.flat().map(([, rssi]) => rssi).filter((rssi) => rssi !== null);
    const [low, high] = [Math.min(-90, ...all), Math.max(-40, ...all)];
    const first_ms = Math.min(now_ms - 30000, ...series.flat().map(([at_ms]) => at_ms));
    pen.fillStyle = pen.strokeStyle = style.getPropertyValue("--ink");
    pen.font = "11px system-ui, sans-serif";
    pen.fillText(`${high} dBm`, 2, 12);
    pen.fillText(`${low} dBm`, 2, height - 16);
    pen.fillText(`${Math.round((now_ms - first_ms) / 1000)} s ago`, 2, height - 3);
    pen.fillText("now", width - 26, height - 3);
    series.forEach((points, index) => {
      pen.setLineDash(ways[index][2]);
      pen.beginPath();
      let before_ms = -Infinity;
      for (const [at_ms, rssi] of points) {
        if (rssi === null) continue;
        const [x, y] = [((at_ms - first_ms) / (now_ms - first_ms)) * width, 6 + ((high - rssi) / (high - low)) * (height - 30)];
        // What was not seen is not drawn.
        if (at_ms - before_ms > GAP_MS) pen.moveTo(x, y);
        else pen.lineTo(x, y);
        before_ms = at_ms;
        // One that stands alone is seen, too.
        pen.fillRect(x - 1, y - 1, 2, 2);
      }
      pen.stroke();
    });
    const pair = this.model.pairs.get(`${one}-${other}`);
    const distance = pair ? `, ${pair.distance.toFixed(1)} m apart` : "";
    const [there, back] = series.map(rangeText);
    caption.textContent = `${one} hears ${other}${there}: full line; ${other} hears ${one}${back}: dashed${distance}.`;
  }
}

/** Between which strengths a pair was heard, in words; empty when it was not. */
function rangeText(points) {
  const all = points.map(([, rssi]) => rssi).filter((rssi) => rssi !== null);
  return all.length ? ` with ${Math.min(...all)} to ${Math.max(...all)} dBm in ${all.length} seconds` : "";
}

function cell(tag, text, scope) {
  const made = document.createElement(tag);
  made.textContent = text;
  if (scope) made.scope = scope;
  return made;
}
