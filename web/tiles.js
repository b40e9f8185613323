// The merged map as pictures, a canvas a tile, of one slice of altitude or of all together: then what is occupied in any slice is
// occupied, and free what is free in some and occupied in none. Chosen by a list or by a key.

/** @import { Model } from "./model.js" */

import { cellColour, FREE_TO, OCCUPIED_FROM, SIDE } from "./draw.js";
import { say } from "./stop.js";

export class MapTiles {
  /** `wanted` is told when another slice is chosen. */
  constructor(/** @type {Model} */ model, wanted) {
    this.model = model;
    this.wanted = wanted;
    /** The slice that is shown; null = all. */
    this.slice = null;
    /** Counts how often what is shown has changed. */
    this.version = 0;
    this.tiles = new Map();
    this.joined = new Map();
    this.choice = document.getElementById("slice");
    this.choice.addEventListener("change", () => this.choose(this.choice.value === "" ? null : Number(this.choice.value)));
    addEventListener("keydown", (event) => {
      const isOff = document.documentElement.dataset.keys === "off" || event.target.matches?.("input, select, textarea");
      if (isOff || event.ctrlKey || event.altKey || event.metaKey || event.key.toLowerCase() !== "l") return;
      event.preventDefault();
      this.next();
    });
  }

  choose(slice) {
    this.slice = slice;
    this.version += 1;
    this.showChoice();
    this.wanted();
  }

  /** All, then one after the other, the lowest first. */
  next() {
    const all = [null, ...this.known()];
    if (all.length < 3) {
      say("The map has one slice of altitude: all of it is shown.");
      return;
    }
    this.choose(all[(all.indexOf(this.slice) + 1) % all.length]);
    say(`The map shows ${this.name(this.slice)}.`);
  }

  /** The slices that the venue names or that something is known of, ascending. */
  known() {
    const borders = this.model.place?.slices_m ?? [];
    const named = Array.from({ length: Math.max(0, borders.length - 1) }, (_, slice) => slice);
    const heard = [...this.model.tiles.values()].map(({ slice }) => slice);
    return [...new Set([...named, ...heard, 0])].sort((a, b) => a - b);
  }

  name(slice) {
    if (slice === null) return "all altitudes";
    const [from, to] = this.bordersOf(slice) ?? [];
    return from === undefined ? `slice ${slice}` : `slice ${slice}, ${from} to ${to} m`;
  }

  /** The heights between which a slice lies, if the venue names them. */
  bordersOf(slice) {
    const borders = this.model.place?.slices_m ?? [];
    return slice >= 0 && slice + 1 < borders.length ? [borders[slice], borders[slice + 1]] : null;
  }

  /** Whether a height belongs to what is shown; what is below the lowest border belongs to the lowest slice, and so above. */
  shows(z_m) {
    const borders = this.bordersOf(this.slice ?? -1);
    if (!borders) return true;
    const isLast = this.slice + 2 === this.model.place.slices_m.length;
    return (this.slice === 0 || z_m >= borders[0]) && (isLast || z_m < borders[1]);
  }

  showChoice() {
    const known = this.known();
    const key = JSON.stringify([known, this.model.place?.slices_m, this.slice]);
    if (key === this.drawnKey) return;
    this.drawnKey = key;
    document.getElementById("slice-choice").hidden = known.length < 2;
    this.choice.replaceChildren(...[null, ...known].map((slice) => new Option(this.name(slice), slice ?? "", false, slice === this.slice)));
  }

  /** Takes the tiles that have changed. */
  take() {
    const { model } = this;
    if (this.generation !== model.generation) [this.tiles, this.joined] = [new Map(), new Map()];
    this.generation = model.generation;
    if (model.changedTiles.size > 0) this.version += 1;
    const places = new Map();
    for (const key of model.changedTiles) {
      const tile = model.tiles.get(key);
      this.tiles.set(key, paint(tile, this.tiles.get(key)?.picture));
      places.set(`${tile.x}/${tile.y}`, tile);
    }
    if (places.size > 0) this.join(places);
    model.changedTiles.clear();
    this.showChoice();
  }

  join(places) {
    const slices = this.known();
    for (const [place, { x, y }] of places) {
      const all = slices.map((slice) => this.tiles.get(`${slice}/${place}`)).filter(Boolean);
      this.joined.set(place, all.length === 1 ? all[0] : paint({ slice: null, x, y, cells: together(all.map(({ tile }) => tile.cells)) }));
    }
  }

  /** The tiles that are shown, each with its picture. */
  shown() {
    if (this.slice === null) return [...this.joined.values()];
    return this.ofSlices();
  }

  /** The same, but of all slices one by one. */
  ofSlices() {
    return [...this.tiles.values()].filter(({ tile }) => this.slice === null || tile.slice === this.slice);
  }

  /** What is known of a place. */
  cellWord(x, y) {
    const cell = this.model.place?.cell_m ?? 0.1;
    const [cx, cy] = [Math.floor(x / cell), Math.floor(y / cell)];
    const place = `${Math.floor(cx / SIDE)}/${Math.floor(cy / SIDE)}`;
    const known = this.slice === null ? this.joined.get(place) : this.tiles.get(`${this.slice}/${place}`);
    if (!known) return "unknown";
    const value = known.tile.cells[(((cy % SIDE) + SIDE) % SIDE) * SIDE + (((cx % SIDE) + SIDE) % SIDE)];
    return value >= OCCUPIED_FROM ? "occupied" : value <= FREE_TO ? "free" : "unknown";
  }
}

/** What several slices say of the cells of a tile. */
function together(all) {
  return all[0].map((_, at) => {
    const values = all.map((cells) => cells[at]);
    const most = Math.max(...values);
    return most >= OCCUPIED_FROM ? most : Math.min(...values);
  });
}

function paint(tile, picture = document.createElement("canvas")) {
  [picture.width, picture.height] = [SIDE, SIDE];
  const pen = picture.getContext("2d");
  const pixels = pen.createImageData(SIDE, SIDE);
  for (let y = 0; y < SIDE; y++) {
    for (let x = 0; x < SIDE; x++) pixels.data.set(cellColour(tile.cells[y * SIDE + x]), ((SIDE - 1 - y) * SIDE + x) * 4);
  }
  pen.putImageData(pixels, 0, 0);
  return { tile, picture };
}
