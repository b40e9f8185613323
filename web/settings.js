// What is set, with the meaning of each key as it is declared, searched by words; and the files of runs, saved on this machine.

/** @import { Model } from "./model.js" */

import { imageCanvas } from "./image.js";
import { ANSWERED_WITHIN_MS } from "./pace.js";

/** The settings of a node are asked for this often while they are shown. */
const LOADS_EVERY_MS = 5000;
/** What is to be saved is waited for so long. */
const SAVED_WITHIN_MS = 60_000;

export class SettingsPanel {
  constructor(/** @type {Model} */ model, scene, token) {
    this.model = model;
    this.scene = scene;
    this.token = token;
    /** What keys may be, once that was asked; a promise of text. */
    this.declared = null;
    this.wanted = () => {};
    this.rows = null;
    this.text = null;
    this.isUnsaid = false;
    this.loaded_ms = 0;
    this.find = document.getElementById("settings-find");
    this.find.addEventListener("input", () => this.list());
    this.of = document.getElementById("settings-of");
    this.of.addEventListener("change", () => this.load());
    const on = (id, act) => document.getElementById(id).addEventListener("click", act);
    on("save-links", () => this.saveLinks());
    on("save-image", () => this.saveImage());
    on("save-picture", () => this.savePicture());
    for (const format of ["waypoints", "plan"]) on(`save-${format}`, () => this.savePlaces(format));
    on("export-files", () => this.listFiles());
    document.getElementById("save-run").addEventListener("input", () => this.showCommand());
  }

  draw() {
    if (this.place !== this.model.place) {
      this.place = this.model.place;
      this.load();
    }
    this.offer();
    // A node may say its settings later, or start with others.
    if (this.of.value && performance.now() - this.loaded_ms > LOADS_EVERY_MS) this.load();
    const field = document.getElementById("save-run");
    if (field.value === "" && this.model.ground?.run) field.value = String(this.model.ground.run);
    this.showCommand();
  }

  showCommand() {
    const run = document.getElementById("save-run").value || "N";
    document.getElementById("save-command").textContent = `tomoswarm export STORE --out FOLDER --run ${run}`;
  }

  /** Nodes that have come since; in a simulation all is in one place, and a recording says nothing of it. */
  offer() {
    if (!this.model.isLive()) return;
    const known = new Set([...this.of.options].map((option) => option.value));
    const nodes = [["ground", "the ground station"], ...this.model.ids().map((id) => [String(id), `vehicle ${id}`])];
    for (const [value, text] of nodes) {
      if (known.has(value)) continue;
      const option = document.createElement("option");
      Object.assign(option, { value, textContent: text });
      this.of.append(option);
    }
  }

  async load() {
    const of = this.of.value;
    this.loaded_ms = performance.now();
    // One question at a time; what was asked of another node is told to nobody.
    const asked = this.asked = this.asked?.of === of ? this.asked : { of };
    asked.answer ??= this.ask(of ? `settings?of=${of}` : "settings", {}, "No settings", ANSWERED_WITHIN_MS);
    const answer = await asked.answer;
    if (this.asked !== asked) return;
    this.asked = null;
    // Another node may have been chosen meanwhile.
    const text = answer ? await answer.text() : "";
    if (of !== this.of.value || (text === this.text && answer)) return;
    if (this.isUnsaid && answer) this.say("");
    this.isUnsaid = !answer;
    this.text = text;
    const rows = this.rows = rowsOf(text);
    this.list();
    // What keys may be is the same for all, and asked for once.
    this.declared ??= this.ask("settings?keys", {}, "No defaults", ANSWERED_WITHIN_MS).then((said) => said?.text() ?? "");
    const declared = declaredKeys(await this.declared);
    if (declared.size === 0) this.declared = null;
    // Another node's are shown meanwhile.
    if (rows !== this.rows) return;
    const kind = text.match(/^kind = "([a-z]+)"/m)?.[1];
    // The keys of missions stand in a table of their own.
    const ofMission = (row) => (row.table === "mission" ? declared.get(`mission .${row.key}`) : undefined);
    for (const row of rows) row.declared = declared.get(`${kind} ${row.table}.${row.key}`) ?? ofMission(row);
    this.list();
  }

  list() {
    const words = this.find.value.toLowerCase().split(/\s+/).filter(Boolean);
    const rows = (this.rows ?? []).filter((row) => words.every((word) => row.text.includes(word)));
    document.getElementById("settings-count").textContent = `${rows.length} of ${this.rows?.length ?? 0} keys`;
    document.getElementById("settings-list").replaceChildren(...rows.map(rowElement));
  }

  /** The answer, or null after saying why there is none. */
  async ask(what, options = {}, otherwise = "Not saved", within_ms = SAVED_WITHIN_MS) {
    try {
      const headers = { Authorization: `Bearer ${this.token}` };
      const answer = await fetch(what, { ...options, headers, signal: AbortSignal.timeout(within_ms) });
      if (answer.ok) return answer;
      this.say(`${otherwise}: ${await answer.text()}.`);
    } catch {
      this.say(`${otherwise}: the server does not answer.`);
    }
    return null;
  }

  say(text) {
    document.getElementById("save-result").textContent = text;
  }

  run() {
    return Number(document.getElementById("save-run").value);
  }

  async saveLinks() {
    const answer = await this.ask(`links?run=${this.run()}`);
    if (answer) this.save(`run-${this.run()}-links.csv`, [await answer.text()], "text/csv");
  }

  /** The files of `tomoswarm export` that there are of the run, each with a button. */
  async listFiles() {
    const run = this.run();
    const answer = await this.ask(`export?run=${run}`);
    const { from, files } = answer ? await answer.json() : { from: "", files: [] };
    document.getElementById("export-from").textContent = answer ? `Files of run ${run}, from ${from}:` : "";
    const rows = files.map((name) => {
      const [row, button] = [document.createElement("li"), document.createElement("button")];
      button.type = "button";
      button.textContent = name;
      button.addEventListener("click", () => this.saveFile(run, name));
      row.append(button);
      return row;
    });
    document.getElementById("export-list").replaceChildren(...rows);
    if (answer) this.say(`${files.length} files of run ${run} can be saved.`);
  }

  async saveFile(run, name) {
    this.say(`${name} is being made …`);
    const answer = await this.ask(`export?run=${run}&file=${name}`);
    if (answer) this.save(name, [await answer.blob()], "application/octet-stream");
  }

  image() {
    const image = this.model.images.get(Number(document.getElementById("image-subject").value));
    if (!image) this.say("Not saved: there is no image yet.");
    return image;
  }

  name(image) {
    return `run-${image.run}-${image.subject === 1 ? "change" : "structure"}`;
  }

  /** The values as NumPy has them: rows from south to north, dB/m. */
  saveImage() {
    const image = this.image();
    if (image) this.save(`${this.name(image)}.npy`, [npyHeader(image.rows, image.columns), image.mean.buffer], "application/octet-stream");
  }

  savePicture() {
    const image = this.image();
    if (!image) return;
    const plane = document.getElementById("image-plane").value;
    imageCanvas(this.model, image, plane, false).toBlob((blob) => this.save(`${this.name(image)}-${plane}.png`, [blob], "image/png"));
  }

  /** The places that are drawn, as a mission of QGroundControl: text (.waypoints) or JSON (.plan). */
  async savePlaces(format) {
    const places = this.scene.sketch;
    if (places.length === 0) {
      this.say("Not saved: no places are drawn; choose a mission with places under Begin, and point at the scene.");
      return;
    }
    const answer = await this.ask(`waypoints?as=${format}`, { method: "POST", body: JSON.stringify(places) });
    if (answer) this.save(`places.${format}`, [await answer.text()], "text/plain");
  }

  save(name, parts, type) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(parts, { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    this.say(`Saved: ${name}.`);
  }
}

/** Keys with values and meanings of a file as the program writes it: KEY = VALUE  # unit, meaning. */
export function rowsOf(text) {
  const rows = [];
  let table = "";
  for (const line of text.split("\n")) {
    const head = line.match(/^\[+([^\]]+)\]+/);
    if (head) table = head[1];
    const found = line.match(/^([A-Za-z0-9_]+) = (.*)$/);
    if (head || !found) continue;
    const [value, means] = split(found[2]);
    rows.push({ table, key: found[1], value, means, text: `${table} ${found[1]} ${value} ${means}`.toLowerCase(), declared: null });
  }
  return rows;
}

/** A value and its comment; a # within quotes begins none. */
function split(rest) {
  let isQuoted = false;
  for (let at = 0; at < rest.length; at++) {
    if (rest[at] === '"' && rest[at - 1] !== "\\") isQuoted = !isQuoted;
    if (rest[at] === "#" && !isQuoted) return [rest.slice(0, at).trim(), rest.slice(at + 1).trim()];
  }
  return [rest.trim(), ""];
}

/** The default of each key and what is allowed, of the tables that `tomoswarm check --keys` prints, by "KIND TABLE.KEY". */
export function declaredKeys(text) {
  const declared = new Map();
  let [kind, table] = ["", ""];
  for (const line of text.split("\n")) {
    const begins = line.match(/^<!-- keys of ([a-z]+) -->/);
    if (begins) [kind, table] = [begins[1], ""];
    const head = line.match(/^`\[+([^\]]+)\]+`/);
    if (head) table = head[1];
    const row = line.match(/^\| `([A-Za-z0-9_]+)` \| (.*?) \| (.*?) \| /);
    if (!row) continue;
    const name = `${kind} ${table}.${row[1]}`;
    const known = declared.get(name);
    const either = (of, value) => (known && !known[of].split(" or ").includes(value) ? `${known[of]} or ${value}` : known?.[of] ?? value);
    declared.set(name, { default: either("default", row[2]), allowed: either("allowed", row[3]) });
  }
  return declared;
}

function rowElement({ table, key, value, means, declared }) {
  const made = document.createElement("li");
  const name = document.createElement("code");
  name.textContent = `${table ? `${table}.` : ""}${key} = ${value}`;
  const parts = declared ? [`default: ${declared.default}`, declared.allowed && `allowed: ${declared.allowed}`] : [];
  const known = parts.filter(Boolean).join("; ");
  made.append(name, ` ${means}${known && ` (${known})`}`);
  return made;
}

/** The header of a file of NumPy, version 1.0, of 32-bit floats. */
function npyHeader(rows, columns) {
  const text = `{'descr': '<f4', 'fortran_order': False, 'shape': (${rows}, ${columns}), }`;
  const padded = text.padEnd(Math.ceil((text.length + 11) / 64) * 64 - 11, " ") + "\n";
  const bytes = new Uint8Array(10 + padded.length);
  bytes.set([0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0, padded.length & 255, padded.length >> 8]);
  for (let i = 0; i < padded.length; i++) bytes[10 + i] = padded.charCodeAt(i);
  return bytes;
}
