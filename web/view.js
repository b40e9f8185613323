// Which view of the scene is seen: from above, in three dimensions, or with a vehicle. What 3D needs is loaded when it is asked
// for first; where it cannot be (no WebGL, no three.js), the view from above stays, and a line says why.

/** @import { Model } from "./model.js" */

import { say } from "./stop.js";

const NAMES = { plane: "2D", space: "3D", ride: "ride" };

export class SceneView {
  /** `chosen` is told when another view is seen. */
  constructor(/** @type {Model} */ model, fleet, plane, token) {
    this.model = model;
    this.fleet = fleet;
    this.plane = plane;
    this.token = token;
    this.current = "plane";
    this.space = null;
    /** Under way, or done: 3D is made once, however often it is asked for meanwhile. */
    this.loading = null;
    this.riding = null;
    this.wanted = () => {};
    /** Told which place of the ground a pointer is over in three dimensions; null = it has left. */
    this.hovered = (_at) => {};
    this.buttons = Object.keys(NAMES).map((name) => [name, document.getElementById(`view-${name}`)]);
    for (const [name, button] of this.buttons) button.addEventListener("click", () => this.choose(name));
    addEventListener("selected", () => this.follow());
    addEventListener("keydown", (event) => {
      const isOff = document.documentElement.dataset.keys === "off" || event.target.matches?.("input, select, textarea");
      const name = { v: this.current === "plane" ? "space" : "plane", g: "ride" }[event.key.toLowerCase()];
      if (name && !isOff && !event.ctrlKey && !event.altKey && !event.metaKey) this.choose(name);
    });
    this.show();
  }

  async choose(name) {
    if (name !== "plane" && !(await this.load())) return;
    this.follow();
    if (name === "ride" && this.riding === null) {
      say("There is nobody to ride with: no vehicle's place is known.");
      return;
    }
    this.current = name;
    this.space?.enter(this.current);
    this.show();
    this.plane.moved();
    this.wanted();
    // Keys that fly or move are those of what is seen.
    document.getElementById(name === "plane" ? "plane" : "space").focus();
  }

  /** The vehicle that is ridden with: the first that is selected, or else the first of all. */
  follow() {
    const ids = [...this.fleet.selected].sort((a, b) => a - b);
    const placed = this.model.ids().filter((id) => this.model.states.get(id)?.isPlaced);
    this.riding = ids.find((id) => placed.includes(id)) ?? (placed.includes(this.riding) ? this.riding : placed[0] ?? null);
    if (this.space) this.space.riding = this.riding;
    this.show();
    if (this.current === "ride") this.wanted();
  }

  /** Whether there are three dimensions. */
  async load() {
    try {
      await (this.loading ??= import("./scene3d.js").then(({ Space }) => this.make(Space)));
      return true;
    } catch (error) {
      this.loading = null;
      say(`3D cannot be shown here (${error.message}). The view from above shows the same, and STOP works.`);
      return false;
    }
  }

  make(Space) {
    const space = new Space(this.model, this.plane, this.token);
    space.wanted = () => this.wanted();
    space.hovered = (at) => this.hovered(at);
    space.moved = () => this.plane.moved();
    this.space = space;
  }

  /** The place in the middle of what is seen; null = there is none. */
  middle() {
    return this.current === "plane" ? this.plane.middle() : this.space.groundAt(0, 0);
  }

  show() {
    const isPlane = this.current === "plane";
    for (const [name, button] of this.buttons) {
      button.setAttribute("aria-pressed", String(name === this.current));
      const whom = name === "ride" && this.riding !== null ? ` ${this.riding}` : "";
      button.textContent = `${NAMES[name]}${whom}`;
    }
    document.getElementById("plane").hidden = !isPlane;
    document.getElementById("space").hidden = isPlane;
    document.getElementById("space-keys").hidden = isPlane;
  }

  draw(now_ms) {
    if (this.current === "plane") this.plane.draw(now_ms);
    else this.space.draw(now_ms);
  }
}
