// What makes vehicles move: buttons that are held for a second, the seat, and how orders fared.

/** @import { Model } from "./model.js" */

import { CutMotors } from "./cut.js";
import { setText } from "./pace.js";
import { post, say } from "./stop.js";

const HELD_MS = 1000;
const RENEW_MS = 5000;

export class Orders {
  constructor(/** @type {Model} */ model, fleet) {
    this.model = model;
    this.fleet = fleet;
    /** Whether the server is there: a seat that is renewed in vain takes up the connections that Stop needs. */
    this.isConnected = () => false;
    for (const order of ["start", "return", "land"]) this.heldButton(order, () => this.give(order));
    this.heldButton("take-seat", () => this.takeSeat());
    this.cut = new CutMotors(this);
    addEventListener("selected", () => this.showTargets());
    setInterval(() => {
      if (this.hasSeat() && !document.hidden && this.isConnected()) post({ order: "seat" });
    }, RENEW_MS);
  }

  /** Who looks back has no seat: what is known of it is of then. */
  hasSeat() {
    const page = this.model.place?.page;
    return page !== undefined && this.model.isPresent() && this.model.orders.seat === page;
  }

  /** A button that acts when it was held long enough, by pointer or by Enter. */
  heldButton(id, act, held_ms = HELD_MS) {
    const button = document.getElementById(id);
    let [timer, words, lease] = [null, "", 0];
    const begin = () => {
      if (timer !== null || button.disabled) return;
      [words, lease] = [button.textContent, this.model.orders.lease];
      button.classList.add("filling");
      timer = setTimeout(() => {
        end();
        // Whoever holds a button has read what stood on it; and a button that is disabled meanwhile may hear of no release.
        if (button.disabled || button.textContent !== words) say("What the button does has changed while it was held: nothing is given.", "refused");
        // Another number there, and somebody else has taken over: what is ordered now would be above an order that was not seen.
        else if (id !== "take-seat" && this.model.orders.lease !== lease) say(`Lease ${this.model.orders.lease} has come in place of ${lease} while the button was held: nothing is given.`, "refused");
        else act();
      }, held_ms);
    };
    const end = () => {
      clearTimeout(timer);
      timer = null;
      button.classList.remove("filling");
    };
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      // A finger is caught by what it touches, and would not leave it.
      if (button.hasPointerCapture(event.pointerId)) button.releasePointerCapture(event.pointerId);
      begin();
    });
    for (const kind of ["pointerup", "pointerleave", "pointercancel", "blur"]) button.addEventListener(kind, end);
    button.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && !event.repeat) begin();
    });
    button.addEventListener("keyup", (event) => {
      if (event.key === "Enter") end();
    });
    document.addEventListener("visibilitychange", end);
  }

  async give(order) {
    const vehicles = [...this.fleet.selected];
    const number = await post({ order, vehicles });
    if (number !== null) say(`${order} is given to ${vehicles.length ? vehicles.join(", ") : "all"}.`, "given");
  }

  async takeSeat() {
    const number = await post({ order: "seat", take_over: true });
    if (number !== null) say("This page has the seat.", "given");
  }

  showTargets() {
    const ids = [...this.fleet.selected].sort((a, b) => a - b);
    const whom = ids.length ? ids.join(", ") : `all (${this.model.ids().join(", ") || "none heard"})`;
    for (const [id, word] of [["start", "Start"], ["return", "Return"], ["land", "Land"]]) {
      const button = document.getElementById(id);
      setText(button, `${word} ${whom}`);
      button.disabled = !this.hasSeat();
      button.title = this.hasSeat() ? "hold for a second" : "this page has not the seat";
    }
    const begin = document.getElementById("begin-mission");
    setText(begin, `Begin with ${whom}: hold for a second`);
    begin.disabled = !this.hasSeat();
    this.cut.show();
    setText(document.getElementById("hold"), `Hold ${ids.length ? ids.join(", ") : "all"} (H)`);
  }

  show() {
    const { orders, place } = this.model;
    this.showTargets();
    const seat = document.getElementById("take-seat");
    const mayOrder = place?.mayOrder === true;
    seat.disabled = !mayOrder || this.hasSeat();
    const word = this.hasSeat() ? "This page has the seat" : orders.seat === null ? "Take the seat" : `Take over the seat from page ${orders.seat}`;
    setText(seat, word);
    const holder = orders.seat === null ? "free" : this.hasSeat() ? "this page" : `page ${orders.seat}`;
    // Which operator's word holds: another number there, and somebody else has taken over.
    setText(document.getElementById("seat"), `seat: ${holder}${orders.lease > 0 ? ` · lease ${orders.lease}` : ""}`);
    if (this.model.isPresent()) this.showLink(orders.isLinked);
    this.fill("stops", orders.stops.map(stopText));
    this.fill("given", [...orders.orders].reverse().map((order) => this.orderText(order)));
  }

  /** Shows whether anybody is reached now. An earlier moment does not say that, so what was known last stays meanwhile. */
  showLink(isLinked) {
    document.getElementById("bar").classList.toggle("unlinked", !isLinked);
    if (this.wasLinked === false && isLinked) say("");
    this.wasLinked = isLinked;
    if (isLinked) return;
    say("Cannot stop from here: nobody is reached. Use the radio, or tomoswarm order CONFIG emergency.", "refused");
  }

  orderText(order) {
    const whom = order.vehicles.length ? order.vehicles.join(", ") : "all";
    const mission = order.mission ? ` ${order.mission}` : "";
    const head = `${order.what}${mission} ${whom}, by page ${order.page}`;
    if (order.refused) return [`${head}: refused, ${order.refused}`, "failed"];
    if (!order.isOver) return [`${head}: on its way`, "open"];
    const fates = order.fates.map((fate) => `${fate.vehicle} ${fate.words}`).join("; ");
    return [`${head}: ${order.isDone ? "done" : "NOT DONE"}: ${fates || "nobody is heard"}`, order.isDone ? "done" : "failed"];
  }

  fill(id, lines) {
    const list = document.getElementById(id);
    const key = JSON.stringify(lines);
    if (list.dataset.lines === key) return;
    list.dataset.lines = key;
    const items = lines.map(([text, kind]) => {
      const item = document.createElement("li");
      item.textContent = text;
      item.className = kind;
      return item;
    });
    list.replaceChildren(...items);
  }
}

function stopText(stop) {
  const whom = stop.vehicle === null ? "all vehicles" : `vehicle ${stop.vehicle}`;
  const shown = stop.shown.length ? `shown by ${stop.shown.join(", ")}` : "shown by nobody yet";
  const open = stop.notShown.length ? `, NOT shown by ${stop.notShown.join(", ")}` : "";
  const ends = stop.isMany
    ? "It stands for more stops than have names: no start from here lifts it, but tomoswarm order CONFIG start --lift-all does."
    : "A start lifts it.";
  return [`STOP ${stop.name} for ${whom}, by operator ${stop.by}: ${shown}${open}. ${ends}`, "stop"];
}
