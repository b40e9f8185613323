// The table of vehicles, the ground station, and which vehicles are selected. Texts of nodes are set as text only. What troubles a
// vehicle stands whole in a row of its own below the vehicle's, as wide as the table; that one names it to a screen reader, too.

import { setText } from "./pace.js";
import { say } from "./stop.js";

const TYPED_WITHIN_MS = 800;
const COLUMNS = 9;
/** A ground station that says nothing for so long is silent. */
export const GROUND_SILENT_MS = 5000;

export class Fleet {
  constructor(model) {
    this.model = model;
    this.selected = new Set();
    this.rows = new Map();
    this.body = document.querySelector("#vehicles tbody");
    this.typed = "";
    this.typed_ms = 0;
    /** What was selected before a number was typed. */
    this.before = [];
    addEventListener("keydown", (event) => this.key(event));
    this.showSelection();
  }

  key(event) {
    const isOff = document.documentElement.dataset.keys === "off" && event.key !== "Escape";
    const isElsewhere = isOff || event.ctrlKey || event.altKey || event.metaKey || event.target.matches?.("input, select, textarea");
    if (isElsewhere || event.target.id === "plane" && event.key === "0") return;
    if (event.key === "Escape") return this.select([]);
    if (event.key.toLowerCase() === "a") return this.select(this.model.ids());
    if (!/^[0-9]$/.test(event.key)) return;
    const now_ms = performance.now();
    const goesOn = now_ms - this.typed_ms < TYPED_WITHIN_MS;
    if (!goesOn) this.before = [...this.selected];
    this.typed = goesOn ? this.typed + event.key : event.key;
    this.typed_ms = now_ms;
    const id = Number(this.typed);
    if (this.model.ids().includes(id)) return this.select([id]);
    // Its first digits are no vehicle that was meant.
    this.select(this.before);
    say(`There is no vehicle ${id}.`);
  }

  select(ids) {
    this.selected = new Set(ids);
    this.showSelection();
    this.show(this.model.clock_ms(performance.now()));
  }

  toggle(id) {
    this.selected.has(id) ? this.selected.delete(id) : this.selected.add(id);
    this.showSelection();
    this.show(this.model.clock_ms(performance.now()));
  }

  showSelection() {
    const ids = [...this.selected].sort((a, b) => a - b);
    document.documentElement.dataset.selected = ids.join(",");
    const text = ids.length ? `selected: ${ids.join(", ")}` : "none selected: orders go to all";
    document.getElementById("selection").textContent = text;
    dispatchEvent(new CustomEvent("selected", { detail: ids }));
  }

  show(now_ms) {
    const ids = this.model.ids();
    for (const [id, { row, troubles }] of this.rows) {
      if (ids.includes(id)) continue;
      row.remove();
      troubles.remove();
      this.rows.delete(id);
    }
    for (const id of ids) if (!this.rows.has(id)) this.addRow(id);
    for (const id of ids) this.showRow(id, now_ms);
    this.showGround(now_ms);
  }

  addRow(id) {
    const row = document.createElement("tr");
    row.tabIndex = 0;
    row.dataset.vehicle = String(id);
    row.setAttribute("aria-label", `vehicle ${id}`);
    const head = document.createElement("th");
    head.scope = "row";
    row.append(head);
    for (let i = 1; i < COLUMNS; i++) row.append(document.createElement("td"));
    const troubles = troublesRow(id);
    row.setAttribute("aria-describedby", troubles.firstChild.id);
    for (const of of [row, troubles]) of.addEventListener("click", () => this.toggle(id));
    row.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && !event.repeat) this.toggle(id);
    });
    const after = [...this.body.children].find((other) => Number(other.dataset.vehicle) > id);
    this.body.insertBefore(row, after ?? null);
    row.after(troubles);
    this.rows.set(id, { row, troubles });
  }

  showRow(id, now_ms) {
    const { row, troubles } = this.rows.get(id);
    const state = this.model.states.get(id);
    const vehicle = this.model.vehicles.get(id) ?? {};
    const health = vehicle.health;
    const isSilent = this.model.isSilent(id, now_ms);
    const age_s = state ? (now_ms - state.at_ms) / 1000 : null;
    const wrong = troublesOf(vehicle);
    const texts = [
      `${shape(state, isSilent)} ${id}`,
      isSilent ? (state ? `silent for ${age_s.toFixed(0)} s` : "not heard") : this.doing(state),
      missionText(vehicle.mission),
      state?.battery == null ? "–" : `${Math.round(state.battery * 100)} %`,
      vehicle.ordered ?? "–",
      age_s === null ? "–" : `${age_s.toFixed(1)} s`,
      state?.waiting == null ? "–" : String(state.waiting),
      health ? health.hears.join(", ") || "nobody" : "–",
      wrong.length ? String(wrong.length) : "none",
    ];
    texts.forEach((text, column) => {
      const cell = row.children[column];
      setText(cell, text);
    });
    const [red, green, blue] = this.model.colourOf(id);
    setText(troubles.firstChild, wrong.join("\n"));
    troubles.hidden = wrong.length === 0;
    for (const of of [row, troubles]) of.firstChild.style.borderLeftColor = `rgb(${red}, ${green}, ${blue})`;
    row.classList.toggle("silent", isSilent);
    row.classList.toggle("stopped", state?.standsUnder === 1);
    row.classList.toggle("troubled", wrong.length > 0);
    row.setAttribute("aria-selected", this.selected.has(id) ? "true" : "false");
  }

  doing(state) {
    const place = this.model.place;
    const mode = place?.modes[state.mode] ?? "?";
    const why = place?.standsUnder[state.standsUnder] ?? "";
    const speed = state.isAtRest ? "at rest" : `${state.speed.toFixed(2)} m/s`;
    return [mode, why && why !== mode && mode !== "STOPPED" && `(${why})`, speed].filter(Boolean).join(" ");
  }

  showGround(now_ms) {
    const ground = this.model.ground;
    const box = document.getElementById("ground");
    if (!ground?.isHeard) {
      setText(box, "ground station: not heard");
      return;
    }
    const age_s = (now_ms - ground.at_ms) / 1000;
    const isSilent = age_s > GROUND_SILENT_MS / 1000;
    const parts = [
      `ground station: ${ground.phase}, run ${ground.run}, lap ${ground.lapsDone} of ${ground.laps}`,
      `${ground.samples} samples, ${ground.images} images, lease ${ground.lease}`,
      isSilent ? `SILENT for ${age_s.toFixed(0)} s` : "",
      ground.lost.length ? `lost: ${ground.lost.join(", ")}` : "",
      ground.troubles.join("; "),
    ];
    setText(box, parts.filter(Boolean).join(" · "));
    box.classList.toggle("silent", isSilent);
  }
}

function shape(state, isSilent) {
  if (isSilent) return "?";
  if (state.standsUnder === 1) return "✖";
  return state.isAtRest ? "■" : "▲";
}

function missionText(mission) {
  if (!mission) return "–";
  const share = mission.share === null ? "" : `${Math.round(mission.share * 100)} %`;
  const end = mission.end ? `ended: ${mission.end}` : mission.phase;
  return [mission.kind, end, share, mission.isAtHome ? "at home" : ""].filter(Boolean).join(" ");
}

/** The row that says what troubles a vehicle. */
function troublesRow(id) {
  const row = document.createElement("tr");
  row.className = "troubles";
  row.hidden = true;
  row.setAttribute("aria-label", `troubles of vehicle ${id}`);
  const cell = document.createElement("td");
  cell.colSpan = COLUMNS;
  cell.id = `troubles-${id}`;
  row.append(cell);
  return row;
}

function troublesOf(vehicle) {
  const all = [vehicle.misfit, ...(vehicle.health?.troubles ?? [])].filter(Boolean);
  const steered = vehicle.control && vehicle.control !== "this software" ? [`steered by ${vehicle.control}`] : [];
  return [...steered, ...all];
}
