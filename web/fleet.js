// The table of vehicles, the ground station, and which vehicles are selected. Texts of nodes are set as text only. What troubles a
// vehicle stands whole in a row of its own below the vehicle's, as wide as the table, and so does what stands in columns for which
// a narrow window has no room; the vehicle's row names both to a screen reader, too.
// Rows stand in the order of the column whose head was pressed, and change places only while nobody points at them.

/** @import { Model } from "./model.js" */
/** @import { ToldVehicle, VehicleMission } from "./told" */

import { setText } from "./pace.js";
import { say } from "./stop.js";

const TYPED_WITHIN_MS = 800;
/** What rows are sorted by, a column each, from what is least or wants the eye first; whoever has none comes last. */
const SORTED_BY = [
  ({ id }) => id,
  ({ row }) => row.children[1].textContent,
  ({ vehicle }) => vehicle.mission?.share,
  ({ state }) => state?.battery,
  ({ row }) => row.children[4].textContent,
  ({ state }) => state && -state.at_ms,
  ({ state }) => state?.waiting,
  ({ vehicle }) => vehicle.health?.hears.length,
  ({ row }) => row.children[8].textContent,
  ({ vehicle }) => -troublesOf(vehicle).length,
];
const SORTED_EVERY_MS = 2000;
/** A ground station that says nothing for so long is silent. */
export const GROUND_SILENT_MS = 5000;

export class Fleet {
  constructor(/** @type {Model} */ model) {
    this.model = model;
    this.selected = new Set();
    this.rows = new Map();
    this.body = document.querySelector("#vehicles tbody");
    this.typed = "";
    this.typed_ms = 0;
    this.order = { column: 0, isDown: false, at_ms: -Infinity };
    this.heads = [...document.querySelectorAll("#vehicles thead th")];
    this.heads.forEach((head, column) => head.firstChild.addEventListener("click", () => this.sortBy(column)));
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
    for (const [id, { row, below }] of this.rows) {
      if (ids.includes(id)) continue;
      row.remove();
      below.remove();
      this.rows.delete(id);
    }
    for (const id of ids) if (!this.rows.has(id)) this.addRow(id);
    const hidden = this.hiddenColumns();
    for (const id of ids) this.showRow(id, now_ms, hidden);
    this.sort();
    this.showGround(now_ms);
  }

  /** The columns for which there is no room: the style says which. */
  hiddenColumns() {
    return [...this.heads.keys()].filter((column) => getComputedStyle(this.heads[column]).display === "none");
  }

  /** Sorts by a column; by the same one again, the other way round. */
  sortBy(column) {
    this.order = { column, isDown: this.order.column === column && !this.order.isDown, at_ms: -Infinity };
    this.sort();
  }

  /** Puts the rows into their order, unless somebody is about to press one, or has just seen them change. */
  sort() {
    const { column, isDown, at_ms } = this.order;
    const now_ms = performance.now();
    const isPressed = at_ms > -Infinity && (now_ms - at_ms < SORTED_EVERY_MS || this.body.matches(":hover, :focus-within"));
    if (isPressed) return;
    this.order.at_ms = now_ms;
    this.heads.forEach((head, of) => {
      if (of === column) head.setAttribute("aria-sort", isDown ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    const keys = new Map([...this.rows].map(([id, { row }]) => {
      const of = { id, row, state: this.model.states.get(id), vehicle: this.model.vehicles.get(id) ?? {} };
      return [id, SORTED_BY[column](of) ?? null];
    }));
    const sorted = [...this.rows.keys()].sort((a, b) => compared(keys.get(a), keys.get(b), isDown) || a - b);
    const stand = [...this.body.children].filter((row) => row.dataset.vehicle).map((row) => Number(row.dataset.vehicle));
    if (sorted.every((id, place) => stand[place] === id)) return;
    for (const id of sorted) {
      const { row, below } = this.rows.get(id);
      this.body.append(row, below);
    }
  }

  /** Moves the focus to the row above or below. */
  step(from, by) {
    const rows = [...this.body.children].filter((row) => row.dataset.vehicle);
    rows[rows.indexOf(from) + by]?.focus();
  }

  addRow(id) {
    const row = document.createElement("tr");
    row.tabIndex = 0;
    row.dataset.vehicle = String(id);
    row.setAttribute("aria-label", `vehicle ${id}`);
    const head = document.createElement("th");
    head.scope = "row";
    row.append(head);
    for (let i = 1; i < SORTED_BY.length; i++) row.append(document.createElement("td"));
    const below = rowBelow(id);
    row.setAttribute("aria-describedby", below.firstElementChild.id);
    for (const of of [row, below]) of.addEventListener("click", () => this.toggle(id));
    row.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && !event.repeat) this.toggle(id);
      if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
      event.preventDefault();
      this.step(row, event.key === "ArrowUp" ? -1 : 1);
    });
    this.body.append(row, below);
    this.rows.set(id, { row, below });
  }

  showRow(id, now_ms, hidden) {
    const { row, below } = this.rows.get(id);
    const state = this.model.states.get(id);
    const vehicle = this.model.vehicles.get(id);
    const health = vehicle?.health;
    const isSilent = this.model.isSilent(id, now_ms);
    const age_s = state ? (now_ms - state.at_ms) / 1000 : null;
    const wrong = troublesOf(vehicle);
    const texts = [
      `${shape(state, isSilent)} ${id}`,
      isSilent ? (state ? `silent for ${age_s.toFixed(0)} s` : "not heard") : this.doing(state),
      missionText(vehicle?.mission),
      state?.battery == null ? "–" : `${Math.round(state.battery * 100)} %`,
      [vehicle?.ordered ?? "–", this.fateOf(id)].filter(Boolean).join(": "),
      age_s === null ? "–" : `${age_s.toFixed(1)} s`,
      state?.waiting == null ? "–" : String(state.waiting),
      health ? health.hears.join(", ") || "nobody" : "–",
      autopilotText(health, state),
      wrong.length ? String(wrong.length) : "none",
    ];
    texts.forEach((text, column) => {
      const cell = row.children[column];
      setText(cell, text);
    });
    const [red, green, blue] = this.model.colourOf(id);
    const [more, troubles] = below.firstElementChild.children;
    setText(more, hidden.map((column) => `${this.heads[column].textContent}: ${texts[column]}`).join(" · "));
    setText(troubles, wrong.join("\n"));
    below.hidden = hidden.length === 0 && wrong.length === 0;
    for (const of of [row, below]) of.firstElementChild.style.borderLeftColor = `rgb(${red}, ${green}, ${blue})`;
    row.classList.toggle("silent", isSilent);
    row.classList.toggle("stopped", state?.standsUnder === 1);
    row.classList.toggle("troubled", wrong.length > 0);
    row.classList.toggle("continued", !below.hidden);
    row.setAttribute("aria-selected", this.selected.has(id) ? "true" : "false");
  }

  /** How the last order that named a vehicle, or all, has fared with it; null when there was none. */
  fateOf(id) {
    const order = this.model.orders.orders.findLast(({ vehicles }) => vehicles.length === 0 || vehicles.includes(id));
    if (!order) return null;
    if (order.refused) return `${order.what} refused`;
    if (!order.isOver) return `${order.what} on its way`;
    return `${order.what} ${order.fates.find((fate) => fate.vehicle === id)?.words ?? "was not for it"}`;
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

function missionText(/** @type {VehicleMission} */ mission) {
  if (!mission) return "–";
  const share = mission.share === null ? "" : `${Math.round(mission.share * 100)} %`;
  const end = mission.end ? `ended: ${mission.end}` : mission.phase;
  return [mission.kind, end, share, mission.isAtHome ? "at home" : ""].filter(Boolean).join(" ");
}

function autopilotText(health, state) {
  const flags = [state?.isArmed && "armed", state?.isLanded && "landed", state?.isForeign && "steered by others"];
  return [health?.autopilot, ...flags].filter(Boolean).join(", ") || "–";
}

/** Which of two comes first: numbers and words in their order, nothing last whichever way round. */
function compared(a, b, isDown) {
  if (a === null || b === null) return Number(a === null) - Number(b === null);
  const sign = typeof a === "string" ? a.localeCompare(b) : a - b;
  return isDown ? -sign : sign;
}

/** The row below a vehicle's: what has no room in that one, and what troubles the vehicle. */
function rowBelow(id) {
  const row = document.createElement("tr");
  row.className = "below";
  row.hidden = true;
  row.setAttribute("aria-label", `more of vehicle ${id}`);
  const cell = document.createElement("td");
  cell.colSpan = SORTED_BY.length;
  cell.id = `below-${id}`;
  const [more, troubles] = [document.createElement("span"), document.createElement("span")];
  troubles.className = "wrong";
  cell.append(more, troubles);
  row.append(cell);
  return row;
}

function troublesOf(/** @type {ToldVehicle} */ vehicle) {
  const all = [vehicle?.misfit, ...(vehicle?.health?.troubles ?? [])].filter(Boolean);
  const steered = vehicle?.control && vehicle.control !== "this software" ? [`steered by ${vehicle.control}`] : [];
  return [...steered, ...all];
}
