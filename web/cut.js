// Cutting motors, apart from all other orders: who falls is said by number, and never by what is selected.

import { setText } from "./pace.js";
import { post, say } from "./stop.js";

const HELD_MS = 1500;

export class CutMotors {
  constructor(orders) {
    this.orders = orders;
    this.input = document.getElementById("cut-numbers");
    this.button = document.getElementById("cut-motors");
    this.hint = document.getElementById("cut-hint");
    orders.heldButton("cut-motors", () => this.give(), HELD_MS);
    this.input.addEventListener("input", () => this.show());
    document.getElementById("cut-form").addEventListener("submit", (event) => event.preventDefault());
    // What was typed is for now, and not for whoever opens it again.
    document.getElementById("cut").addEventListener("toggle", () => this.clear());
  }

  /** The vehicles that are typed, ascending, or why these are none. */
  typed() {
    const text = this.input.value.trim();
    if (text === "") return { why: "Type the number of the vehicle." };
    const numbers = text.split(",").map((part) => part.trim());
    const bad = numbers.find((part) => !/^[0-9]{1,3}$/.test(part));
    if (bad !== undefined) return { why: `Numbers of vehicles are expected, with commas between them: "${bad}" is none.` };
    const ids = [...new Set(numbers.map(Number))].sort((a, b) => a - b);
    const strange = ids.find((id) => !this.orders.model.ids().includes(id));
    return strange === undefined ? { ids } : { why: `There is no vehicle ${strange}.` };
  }

  show() {
    // Who looks back comes to another now.
    if (!this.orders.model.isPresent()) this.input.value = "";
    const { ids, why } = this.typed();
    const hasSeat = this.orders.hasSeat();
    this.button.disabled = !hasSeat || !ids;
    setText(this.button, ids ? `Cut the motors of ${ids.join(", ")}: hold` : "Cut the motors");
    const words = hasSeat ? why ?? "Hold the button for one and a half seconds." : "This page has not the seat.";
    setText(this.hint, words);
  }

  clear() {
    this.input.value = "";
    this.show();
  }

  async give() {
    const { ids } = this.typed();
    // While the button was held the seat may have gone, or the number.
    if (!ids || !this.orders.hasSeat()) return this.show();
    const number = await post({ order: "cut-motors", vehicles: ids });
    if (number === null) return;
    say(`cut-motors is given to ${ids.join(", ")}.`, "given");
    this.clear();
  }
}
