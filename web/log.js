// What happened, newest first: changes, troubles, orders with their fates, marks, lines of nodes' own logs; by vehicle and by kind. Texts are set as text only.

/** @import { Model } from "./model.js" */

import { timeOfDay } from "./model.js";

const SHAPES = { change: "·", trouble: "!", order: "→", image: "▦", mark: "⌖", note: "–" };
const SHOWN_MOST = 200;

export class LogPanel {
  constructor(/** @type {Model} */ model) {
    this.model = model;
    this.wanted = () => {};
    this.vehicle = document.getElementById("log-vehicle");
    this.kind = document.getElementById("log-kind");
    for (const choice of [this.vehicle, this.kind]) choice.addEventListener("change", () => this.wanted());
  }

  draw() {
    this.offer();
    const [vehicle, kind] = [this.vehicle.value, this.kind.value];
    const isWanted = (event) => (kind === "" || event.kind === kind)
      && (vehicle === "" || event.vehicles.length === 0 || event.vehicles.includes(Number(vehicle)));
    const wanted = this.model.events.filter(isWanted).slice(-SHOWN_MOST).reverse();
    document.getElementById("log-list").replaceChildren(...wanted.map((event) => line(event, this.model.isLive())));
  }

  /** Vehicles that have come since. */
  offer() {
    const known = new Set([...this.vehicle.options].map((option) => option.value));
    for (const id of this.model.ids()) {
      if (known.has(String(id))) continue;
      const option = document.createElement("option");
      option.value = option.textContent = String(id);
      this.vehicle.append(option);
    }
  }
}

function line(event, isLive) {
  const item = document.createElement("li");
  item.className = event.kind;
  const time = document.createElement("time");
  time.dateTime = event.at.toISOString();
  time.textContent = timeOfDay(event.at, isLive);
  const whom = event.vehicles.length ? ` ${event.vehicles.join(", ")}:` : "";
  // The text of an order, an image or a mark says that it is one.
  const kind = ["order", "image", "mark"].includes(event.kind) ? "" : ` ${event.kind}`;
  item.append(time, ` ${SHAPES[event.kind] ?? "·"}${kind}${whom} ${event.text}`);
  return item;
}

/** The name of the local time, such as GMT+2. */
export function zone() {
  const parts = new Intl.DateTimeFormat([], { timeZoneName: "short" }).formatToParts(new Date());
  return parts.find((part) => part.type === "timeZoneName")?.value ?? "";
}
