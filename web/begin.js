// Begins a mission: its kind, its keys with their meaning as the server declares them, places pointed at in the scene, and the
// run that it is compared with. The server judges all of it by the rules of the command line; the page shows the command.

/** @import { Model } from "./model.js" */

import { ANSWERED_WITHIN_MS } from "./pace.js";
import { post, say } from "./stop.js";

/** Keys that the scene can be pointed at for. */
const DRAWN = { waypoints_m: "Add places: point at the scene", centre_m: "Draw it: point at the middle, then at a side" };

export class BeginPanel {
  constructor(/** @type {Model} */ model, fleet, scene, token) {
    this.model = model;
    this.fleet = fleet;
    this.scene = scene;
    this.token = token;
    this.places = [];
    this.fileText = null;
    /** The run that is compared with; "" = none. It stays chosen while the list of runs comes anew. */
    this.compared = "";
    this.wanted = () => {};
    this.form = document.getElementById("begin-form");
    this.kind = document.getElementById("mission-kind");
    this.kind.addEventListener("change", () => this.showKeys());
    document.getElementById("sweep-empty").addEventListener("click", () => this.chooseSweep(""));
    document.getElementById("sweep-compared").addEventListener("click", () => this.chooseSweep(this.emptyRun()));
    document.getElementById("compare-with").addEventListener("input", (event) => { this.compared = event.target.value; });
    this.form.addEventListener("input", () => this.showCommand());
    this.form.addEventListener("submit", (event) => event.preventDefault());
    addEventListener("selected", () => this.showCommand());
  }

  draw() {
    // A connection begins: what was chosen and filled in stays.
    if (!this.model.place) return;
    const missions = this.model.place.missions;
    if (this.kind.options.length !== missions.length) {
      this.kind.replaceChildren(...missions.map(({ kind }) => option(kind, kind)));
      this.showKeys();
    }
    this.offerRuns();
  }

  offerRuns() {
    // A connection begins, and does not know the runs yet.
    if (this.model.ground === null) return;
    const choice = document.getElementById("compare-with");
    const runs = this.model.ground.runs ?? [];
    const empty = this.emptyRun();
    const compared = document.getElementById("sweep-compared");
    compared.disabled = empty === "";
    compared.textContent = empty === "" ? "Sweep (no empty one is done)" : `Sweep, compared with run ${empty}`;
    // A list that is open stays as it is.
    if (choice.dataset.runs === JSON.stringify(runs) || document.activeElement === choice) return;
    choice.dataset.runs = JSON.stringify(runs);
    const options = runs.map((run) => option(String(run.run), runText(run)));
    const isKnown = this.compared === "" || runs.some((run) => String(run.run) === this.compared);
    if (!isKnown) options.push(option(this.compared, `run ${this.compared}: not named by the ground station now`));
    choice.replaceChildren(option("", "none: this is the empty run"), ...options);
    choice.value = this.compared;
    this.showCommand();
  }

  /** The newest sweep that is done and is compared with none; "" = there is none. */
  emptyRun() {
    const runs = this.model.ground?.runs ?? [];
    const isEmpty = (run) => run.kind === "sweep" && run.comparedWith === null && run.end === "done" && Number(run.samples) > 0;
    return String(runs.filter(isEmpty).at(-1)?.run ?? "");
  }

  /** The two sweeps that change detection is made of. */
  chooseSweep(run) {
    this.kind.value = "sweep";
    this.showKeys();
    this.compared = document.getElementById("compare-with").value = run;
    this.showCommand();
  }

  showKeys() {
    const declared = this.model.place?.missions.find(({ kind }) => kind === this.kind.value);
    this.clearSketch();
    this.fileText = null;
    document.getElementById("begin-result").textContent = "";
    const boxes = (declared?.keys ?? []).map((key) => this.keyBox(key));
    document.getElementById("mission-keys").replaceChildren(...boxes);
    this.showCommand();
  }

  keyBox(key) {
    const box = document.createElement("div");
    const label = document.createElement("label");
    label.textContent = `${key.name} `;
    const input = document.createElement("input");
    input.type = "text";
    input.name = key.name;
    input.placeholder = key.default;
    input.autocomplete = "off";
    label.append(input);
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.id = `hint-${key.name}`;
    hint.textContent = `${key.means}. ${key.allowed ? `Allowed: ${key.allowed}. ` : ""}Left out: ${key.default}.`;
    input.setAttribute("aria-describedby", hint.id);
    box.append(label, hint);
    if (DRAWN[key.name]) box.append(this.drawButton(key.name, input));
    if (key.name === "file") box.append(this.fileInput(input));
    return box;
  }

  drawButton(name, input) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = DRAWN[name];
    button.setAttribute("aria-pressed", "false");
    button.addEventListener("click", () => {
      const isOn = button.getAttribute("aria-pressed") !== "true";
      this.clearSketch();
      if (!isOn) return;
      const [list, isList] = [[], name === "waypoints_m"];
      this.scene.setPick((x, y) => {
        const place = [Math.round(x * 100) / 100, Math.round(y * 100) / 100];
        if (isList) {
          list.push(place);
          input.value = `[${list.map(written).join(", ")}]`;
          this.scene.sketch = list;
        } else this.drawSquare(list, place, input);
        this.scene.wanted();
        this.showCommand();
      }, () => button.setAttribute("aria-pressed", "false"));
      button.setAttribute("aria-pressed", "true");
    });
    return button;
  }

  /** The first place is the middle, the second one lies on a side; a third one begins anew. */
  drawSquare(list, place, input) {
    if (list.length === 2) list.length = 0;
    list.push(place);
    const [middle, side] = list;
    input.value = written(middle);
    this.scene.sketch = [middle];
    const size = document.querySelector("#mission-keys input[name=size_m]");
    if (!side || !size) return;
    const half = Math.max(Math.abs(side[0] - middle[0]), Math.abs(side[1] - middle[1]));
    size.value = (2 * half).toFixed(2);
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]];
    this.scene.sketch = corners.map(([x, y]) => [middle[0] + x * half, middle[1] + y * half]);
  }

  /** A file of this browser's machine: its places are drawn where the mission takes places, or else its text goes with the order. */
  fileInput(input) {
    const label = document.createElement("label");
    label.textContent = "from this machine ";
    const chooser = document.createElement("input");
    chooser.type = "file";
    chooser.accept = ".waypoints,.plan,.txt";
    chooser.addEventListener("change", async () => {
      const file = chooser.files[0];
      if (!file) return;
      const list = document.querySelector("#mission-keys input[name=waypoints_m]");
      if (list) return this.loadPlaces(file, list, input);
      this.fileText = await file.text();
      input.value = file.name;
      document.getElementById("begin-result").textContent =
        `${file.name} as it is now goes with the order: ${file.size} bytes, of ${new Date(file.lastModified).toLocaleString()}.`;
      this.showCommand();
    });
    // The same file may have been written anew: it is read again when it is chosen again.
    chooser.addEventListener("click", () => { chooser.value = ""; });
    // A name that is typed is another file, which the vehicles have.
    input.addEventListener("input", () => {
      if (this.fileText !== null) document.getElementById("begin-result").textContent = "The file of this machine is not sent any more.";
      this.fileText = null;
    });
    label.append(chooser);
    return label;
  }

  /** The places of a mission, .waypoints or .plan, as if they had been pointed at. */
  async loadPlaces(file, list, input) {
    const result = document.getElementById("begin-result");
    try {
      const headers = { Authorization: `Bearer ${this.token}` };
      const answer = await fetch("places", { method: "POST", headers, body: await file.text(), signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
      if (!answer.ok) {
        result.textContent = `${file.name} is not loaded: ${await answer.text()}`;
        return;
      }
      const places = await answer.json();
      this.clearSketch();
      list.value = `[${places.map(written).join(", ")}]`;
      input.value = "";
      this.scene.sketch = places;
      this.scene.wanted();
      this.showCommand();
      result.textContent = `${places.length} places of ${file.name} are drawn, and stand in waypoints_m.`;
    } catch {
      result.textContent = `${file.name} is not loaded: the server does not answer.`;
    }
  }

  clearSketch() {
    if (document.querySelector("#mission-keys button[aria-pressed=true]")) this.scene.setPick(null);
    this.scene.sketch = [];
    this.scene.wanted();
  }

  /** The keys that were filled in, each as KEY=VALUE. */
  set() {
    const inputs = [...document.querySelectorAll("#mission-keys input[name]")];
    return inputs.filter((input) => input.value.trim() !== "").map((input) => `${input.name}=${input.value.trim()}`);
  }

  endsRun() {
    return document.getElementById("end-run").checked;
  }

  compareWith() {
    return this.compared === "" ? null : Number(this.compared);
  }

  showCommand() {
    const ids = [...this.fleet.selected].sort((a, b) => a - b);
    const run = this.compareWith();
    const parts = ["tomoswarm order CONFIG start", ...ids, `--mission ${this.kind.value}`, ...this.set().map((set) => `--set '${set}'`)];
    if (run !== null) parts.push(`--compare-with ${run}`);
    if (this.endsRun()) parts.push("--end-run");
    document.getElementById("begin-command").textContent = parts.join(" ");
    document.getElementById("compare-hint").textContent = run === null
      ? "An empty run: nobody may stand in the area while it is measured. Later runs can be compared with it."
      : `Its images show what has changed since run ${run}.`;
  }

  async give() {
    const mission = { kind: this.kind.value, set: this.set(), compare_with: this.compareWith(), end_run: this.endsRun() };
    if (this.fileText !== null) mission.file = this.fileText;
    const number = await post({ order: "start", vehicles: [...this.fleet.selected], mission });
    document.getElementById("begin-result").textContent = number === null
      ? document.getElementById("stop-result").textContent
      : `Order ${number} is given; how it fares stands under Orders.`;
    if (number === null) return;
    document.getElementById("end-run").checked = false;
    this.clearSketch();
    say(`The mission ${mission.kind} is given.`, "given");
  }
}

function written([x, y]) {
  return `[${x}, ${y}]`;
}

/** A run as it is chosen from. */
function runText(run) {
  const with_ = run.comparedWith === null ? "empty" : `compared with ${run.comparedWith}`;
  return `run ${run.run}: ${run.kind}, ${with_}, ${run.samples} samples, ${run.images} images, ${run.end}`;
}

function option(value, text) {
  const made = document.createElement("option");
  made.value = value;
  made.textContent = text;
  return made;
}
