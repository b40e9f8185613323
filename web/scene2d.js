// The scene from above on a canvas: merged map, image, fence, homes, plans, tracks, vehicles with their deviation, finds, marks. x to
// the right, y up, metres.

/** @import { Model } from "./model.js" */

import { css, ellipsePlaces, excessColour, liveLinks, SIDE, TRUTH } from "./draw.js";
import { imageCanvas } from "./image.js";
import { MARK, MARK_RADIUS_M, marksOf } from "./marks.js";
import { arrow, waitsOf } from "./plan.js";
import { MapTiles } from "./tiles.js";

const PADDING = 1.08;
/** A vehicle this high is written with its height, metres. */
const ALOFT_M = 0.5;
/** A pointer that moves less has pointed at something. */
const TAP_PIXELS = 5;

export class Scene {
  constructor(/** @type {Model} */ model) {
    this.model = model;
    this.canvas = document.getElementById("plane");
    this.map = new MapTiles(model, () => this.wanted());
    this.view = null;
    this.layers = Object.fromEntries(["map", "image", "links", "plan", "tracks", "truth", "ghost"].map((name) => [name, document.getElementById(`layer-${name}`)]));
    for (const box of Object.values(this.layers)) box.addEventListener("change", () => this.wanted());
    this.wanted = () => {};
    /** Told the places that are pointed at, while places are asked for. */
    this.pick = null;
    /** Told that places go to somebody else. */
    this.dropped = () => {};
    /** Told them otherwise. */
    this.pointedAt = (_x, _y) => {};
    /** Told where a pointer is, whatever it does there; null = it has left. */
    this.hovered = (_at) => {};
    /** Told that what is seen has moved. */
    this.moved = () => {};
    this.sketch = [];
    /** The cell of which is told who has seen it, by its middle. */
    this.cell = null;
    /** A place that is to be marked, if it is said. */
    this.candidate = null;
    /** The links that made a pixel, if that was asked. */
    this.why = null;
    /** Another run, if there is one. */
    this.ghost = null;
    this.listen();
  }

  listen() {
    const { canvas } = this;
    /** Where each pointer is that is down, by its id. */
    const pointers = new Map();
    /** Where the only one went down; null = there were others, and nothing is pointed at. */
    let down = null;
    canvas.addEventListener("pointerdown", (event) => {
      const at = [event.clientX, event.clientY];
      pointers.set(event.pointerId, at);
      down = pointers.size === 1 ? at : null;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      this.point(event);
      if (!pointers.has(event.pointerId) || !this.view) return;
      const before = [...pointers.values()];
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      this.drag(before, [...pointers.values()]);
    });
    canvas.addEventListener("pointerup", (event) => {
      const isTap = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < TAP_PIXELS;
      if (isTap && this.view) (this.pick ?? this.pointedAt)(...this.placeOf(event));
      if (isTap && this.view && event.pointerType !== "mouse") this.hovered(this.placeOf(event));
      pointers.delete(event.pointerId);
      down = null;
    });
    canvas.addEventListener("pointercancel", (event) => {
      pointers.delete(event.pointerId);
      down = null;
    });
    canvas.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse") this.hovered(null); });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const rect = canvas.getBoundingClientRect();
      this.zoom(Math.exp(-event.deltaY / 400), event.clientX - rect.left, event.clientY - rect.top);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const moves = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
      if (moves[event.key]) this.move(...moves[event.key]);
      else if (event.key === "+") this.zoom(1.25);
      else if (event.key === "-") this.zoom(0.8);
      else if (event.key === "0") this.fit();
      else return;
      event.preventDefault();
    });
    document.getElementById("zoom-in").addEventListener("click", () => this.zoom(1.25));
    document.getElementById("zoom-out").addEventListener("click", () => this.zoom(0.8));
    document.getElementById("zoom-fit").addEventListener("click", () => this.fit());
    // Who has not chosen what to see, sees all of it in a window of another size as well.
    new ResizeObserver(() => {
      if (!this.isChosen) this.view = null;
      this.wanted();
    }).observe(canvas);
  }

  /** What is seen follows the pointers that are down, as they were and as they are: one moves it, and two zoom as well. */
  drag(before, after) {
    const [was, is] = [between(before), between(after)];
    this.move(is.x - was.x, is.y - was.y);
    if (was.apart < TAP_PIXELS || is.apart < TAP_PIXELS) return;
    const rect = this.canvas.getBoundingClientRect();
    this.zoom(is.apart / was.apart, is.x - rect.left, is.y - rect.top);
  }

  /** Lets places that are pointed at go to `pick`, or (null) where they usually go; `dropped` is told when that ends. */
  setPick(pick, dropped = () => {}) {
    const before = this.dropped;
    [this.pick, this.dropped] = [pick, dropped];
    before();
  }

  point(event) {
    if (!this.view) return;
    const [x, y] = this.placeOf(event);
    if (event.pointerType === "mouse") this.hovered([x, y]);
    document.getElementById("pointed").textContent = `x ${x.toFixed(1)} m, y ${y.toFixed(1)} m: ${this.cellWord(x, y)}`;
  }

  /** The place in the middle of what is seen, or will be as soon as it is drawn; null = no place is known. */
  middle() {
    const view = this.view ?? (this.model.place && this.fitted());
    return view && [view.x, view.y];
  }

  placeOf(event) {
    const rect = this.canvas.getBoundingClientRect();
    return this.toPlace(event.clientX - rect.left, event.clientY - rect.top);
  }

  /** What is known of a place. */
  cellWord(x, y) {
    return this.map.cellWord(x, y);
  }

  move(dx, dy) {
    if (!this.view) return;
    this.isChosen = true;
    this.view.x -= dx / this.view.scale;
    this.view.y += dy / this.view.scale;
    this.moved();
    this.wanted();
  }

  zoom(factor, px = this.canvas.clientWidth / 2, py = this.canvas.clientHeight / 2) {
    if (!this.view) return;
    this.isChosen = true;
    const [x, y] = this.toPlace(px, py);
    this.view.scale = Math.min(2000, Math.max(0.5, this.view.scale * factor));
    const [nx, ny] = this.toPlace(px, py);
    this.view.x += x - nx;
    this.view.y += y - ny;
    this.moved();
    this.wanted();
  }

  fit() {
    this.view = null;
    this.isChosen = false;
    this.moved();
    this.wanted();
  }

  /** Everything that the place names is seen. */
  fitted() {
    const places = [...this.model.place.fence, ...this.model.place.area, ...this.model.place.homes];
    const [xs, ys] = [places.map((at) => at[0]), places.map((at) => at[1])];
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const scale = Math.min(this.canvas.clientWidth / (right - left), this.canvas.clientHeight / (high - low)) / PADDING;
    return { x: (left + right) / 2, y: (low + high) / 2, scale };
  }

  /** Pixels of the canvas's box of a place. */
  toPixel(x, y) {
    const { view, canvas } = this;
    return [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];
  }

  toPlace(px, py) {
    const { view, canvas } = this;
    return [view.x + (px - canvas.clientWidth / 2) / view.scale, view.y - (py - canvas.clientHeight / 2) / view.scale];
  }

  draw(now_ms) {
    const { canvas, model } = this;
    this.map.take();
    if (!model.place || canvas.clientWidth === 0) return;
    const ratio = Math.min(devicePixelRatio || 1, 1.5);
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    this.view ??= this.fitted();
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(canvas);
    pen.fillStyle = style.getPropertyValue("--unknown");
    pen.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    this.ink = style.getPropertyValue("--ink");
    this.paper = style.getPropertyValue("--paper");
    if (this.layers.map.checked) this.drawMap(pen);
    if (this.layers.image.checked) this.drawImage(pen);
    if (this.layers.truth.checked) this.drawTruth(pen);
    this.drawPlace(pen);
    if (this.layers.tracks.checked) this.drawTracks(pen);
    if (this.layers.ghost.checked) this.drawGhost(pen);
    if (this.layers.links.checked) this.drawLinks(pen, now_ms);
    this.drawWhy(pen);
    if (this.layers.plan.checked) {
      this.drawPlans(pen);
      this.drawWaits(pen);
    }
    this.drawFinds(pen);
    this.drawMarks(pen);
    this.drawSketch(pen);
    this.drawCell(pen);
    for (const state of model.states.values()) if (state.isPlaced) this.drawVehicle(pen, state, now_ms);
    this.drawScale(pen);
  }

  drawMap(pen) {
    const side = SIDE * this.model.place.cell_m;
    pen.imageSmoothingEnabled = false;
    for (const { tile, picture } of this.map.shown()) {
      const [left, top] = this.toPixel(tile.x * side, (tile.y + 1) * side);
      const [right, low] = this.toPixel((tile.x + 1) * side, tile.y * side);
      if (right < 0 || low < 0 || left > this.canvas.clientWidth || top > this.canvas.clientHeight) continue;
      // Whole pixels, so that no seam shows between two tiles.
      pen.drawImage(picture, Math.round(left), Math.round(top), Math.round(right) - Math.round(left), Math.round(low) - Math.round(top));
    }
  }

  drawImage(pen) {
    const subject = Number(document.getElementById("image-subject").value);
    const image = this.model.images.get(subject);
    if (!image) return;
    const picture = imageCanvas(this.model, image, "mean", true);
    const [left, top] = this.toPixel(image.least_x_mm / 1000, image.greatest_y_mm / 1000);
    const [right, low] = this.toPixel(image.greatest_x_mm / 1000, image.least_y_mm / 1000);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture, left, top, right - left, low - top);
  }

  path(pen, places, isClosed) {
    // Tracks have thousands of places, and the canvas takes longer to say how large it is than to draw a line: it is asked once.
    const { scale } = this.view, [left, top] = this.toPixel(0, 0);
    pen.beginPath();
    places.forEach((at, index) => {
      const [x, y] = [left + at[0] * scale, top - at[1] * scale];
      index === 0 ? pen.moveTo(x, y) : pen.lineTo(x, y);
    });
    if (isClosed) pen.closePath();
    pen.stroke();
  }

  drawPlace(pen) {
    const { fence, area, homes } = this.model.place;
    const [[x0, y0], [x1, y1]] = area;
    pen.strokeStyle = this.ink;
    pen.lineWidth = 1.5;
    this.path(pen, fence, true);
    pen.setLineDash([6, 4]);
    pen.lineWidth = 1;
    this.path(pen, [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], true);
    pen.setLineDash([]);
    pen.font = "11px system-ui, sans-serif";
    homes.forEach((home, index) => {
      const [x, y] = this.toPixel(home[0], home[1]);
      pen.strokeStyle = this.ink;
      pen.lineWidth = 1;
      pen.strokeRect(x - 6, y - 6, 12, 12);
      this.write(pen, `home ${index + 1}`, x + 9, y + 14);
    });
  }

  /** What truly stands in the scene of a simulation. */
  drawTruth(pen) {
    const { outlines, persons } = this.model.place.truth ?? { outlines: [], persons: [] };
    pen.strokeStyle = TRUTH;
    pen.lineWidth = 2;
    for (const outline of outlines) this.path(pen, outline, true);
    pen.setLineDash([4, 3]);
    for (const person of persons) {
      const [x, y] = this.toPixel(person.at[0], person.at[1]);
      pen.strokeStyle = TRUTH;
      this.ring(pen, x, y, person.radius_m);
      this.write(pen, person.name, x + person.radius_m * this.view.scale + 3, y + 4);
    }
    pen.setLineDash([]);
  }

  drawTracks(pen) {
    pen.lineWidth = 1.5;
    for (const [id, track] of this.model.tracks) {
      pen.strokeStyle = css(this.model.colourOf(id), 0.55);
      this.path(pen, track, false);
    }
  }

  /** Where the vehicles of another run were then: broken, hollow and faint. */
  drawGhost(pen) {
    for (const { id, x, y, heading, isOver, track } of this.ghost?.vehicles() ?? []) {
      pen.strokeStyle = css(this.model.colourOf(id), 0.5);
      pen.lineWidth = 1.5;
      pen.setLineDash([4, 4]);
      this.path(pen, track, false);
      pen.setLineDash([]);
      pen.lineWidth = 2;
      const [px, py] = this.toPixel(x, y);
      pen.save();
      this.body(pen, px, py, heading);
      pen.stroke();
      pen.restore();
      pen.font = "12px system-ui, sans-serif";
      this.write(pen, `ghost ${id}${isOver ? ", over" : ""}`, px + 10, py + 16);
    }
  }

  /** The outline of a vehicle; the pen stays turned. */
  body(pen, x, y, heading) {
    const size = this.size();
    pen.translate(x, y);
    pen.rotate(-heading);
    pen.beginPath();
    pen.moveTo(size, 0); pen.lineTo(-size * 0.75, size * 0.7); pen.lineTo(-size * 0.4, 0); pen.lineTo(-size * 0.75, -size * 0.7);
    pen.closePath();
  }

  /** Pixels from a vehicle's middle to its nose. */
  size() {
    return Math.max(8, 0.2 * this.view.scale);
  }

  /** Who hears whom, by what the way costs beyond the path loss. */
  drawLinks(pen, now_ms) {
    pen.font = "11px system-ui, sans-serif";
    for (const { from, to, excess_db } of liveLinks(this.model, now_ms)) {
      pen.strokeStyle = css(excessColour(excess_db), 0.9);
      pen.lineWidth = 2.5;
      pen.setLineDash(excess_db === null ? [3, 5] : []);
      this.path(pen, [[from.x, from.y], [to.x, to.y]], false);
      pen.setLineDash([]);
      const [x, y] = this.toPixel((from.x + to.x) / 2, (from.y + to.y) / 2);
      this.write(pen, excess_db === null ? "not heard" : `${excess_db.toFixed(0)} dB`, x + 5, y - 5);
    }
  }

  /** The links that made a pixel, the stronger the thicker, and the pixel. */
  drawWhy(pen) {
    if (!this.why) return;
    for (const { from, to, colour, share } of this.why.lines) {
      pen.strokeStyle = css(colour, 0.85);
      pen.lineWidth = 1 + 3 * share;
      this.path(pen, [from, to], false);
    }
    const [x, y] = this.toPixel(...this.why.at);
    pen.strokeStyle = this.ink;
    pen.lineWidth = 3;
    pen.strokeRect(x - 8, y - 8, 16, 16);
  }

  drawPlans(pen) {
    for (const [id, plan] of this.model.plans) {
      const colour = this.model.colourOf(id);
      const vehicle = this.model.vehicles.get(id);
      if (vehicle?.run === plan.run && vehicle?.mission?.end == null) {
        pen.strokeStyle = css(colour, 0.8);
        pen.lineWidth = 1;
        pen.setLineDash([2, 3]);
        let from = plan.start;
        for (const stop of plan.stops) {
          this.path(pen, [from, ...stop.route, stop.at], false);
          from = stop.at;
        }
        pen.setLineDash([]);
      }
      const leg = this.model.legOf(id);
      if (leg.length > 1) {
        pen.strokeStyle = css(colour, 1);
        pen.lineWidth = 2.5;
        this.path(pen, leg, false);
      }
    }
  }

  /** The places of a mission that is not given yet. */
  drawSketch(pen) {
    pen.strokeStyle = pen.fillStyle = this.ink;
    pen.lineWidth = 2;
    this.path(pen, this.sketch, false);
    pen.font = "bold 12px system-ui, sans-serif";
    this.sketch.forEach((at, index) => {
      const [x, y] = this.toPixel(at[0], at[1]);
      pen.fillStyle = this.ink;
      pen.fillRect(x - 4, y - 4, 8, 8);
      this.write(pen, String(index + 1), x + 7, y - 5);
    });
  }

  /** The cell of which is told who has seen it. */
  drawCell(pen) {
    if (!this.cell) return;
    const side = Math.max(10, this.model.place.cell_m * this.view.scale);
    const [x, y] = this.toPixel(...this.cell);
    for (const [colour, width] of [[this.paper, 4], [this.ink, 1.5]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.strokeRect(x - side / 2, y - side / 2, side, side);
    }
  }

  /** From who waits to whom it waits for. */
  drawWaits(pen) {
    for (const { vehicle, of } of waitsOf(this.model.timetable?.rows ?? [])) {
      const [one, other] = [this.model.states.get(vehicle), this.model.states.get(of)];
      if (!one?.isPlaced || !other?.isPlaced) continue;
      const [from, to] = [this.toPixel(one.x, one.y), this.toPixel(other.x, other.y)];
      pen.strokeStyle = pen.fillStyle = this.ink;
      pen.lineWidth = 1.5;
      pen.setLineDash([8, 4]);
      arrow(pen, from, to, 10);
      pen.setLineDash([]);
      pen.font = "11px system-ui, sans-serif";
      this.write(pen, `${vehicle} waits for ${of}`, (from[0] + to[0]) / 2 + 6, (from[1] + to[1]) / 2);
    }
  }

  drawFinds(pen) {
    const subject = Number(document.getElementById("image-subject").value);
    for (const find of this.model.finds.get(subject)?.finds ?? []) {
      const [x, y] = this.toPixel(find.at[0], find.at[1]);
      pen.strokeStyle = "#0a7a3a";
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(x - 7, y - 7); pen.lineTo(x + 7, y + 7);
      pen.moveTo(x + 7, y - 7); pen.lineTo(x - 7, y + 7);
      pen.stroke();
      if (find.sd_m !== null) this.path(pen, ellipsePlaces(find), true);
      this.write(pen, find.sd_m === null ? "find" : `find ± ${find.sd_m.toFixed(2)} m`, x + 10, y - 8);
    }
  }

  /** Where somebody truly stands: a ring with a point; broken while it is not stored. */
  drawMarks(pen) {
    for (const { at, word, isStored } of marksOf(this.model, this.candidate)) this.drawMark(pen, at, word, isStored);
  }

  drawMark(pen, at, word, isWhole) {
    const [x, y] = this.toPixel(at[0], at[1]);
    const radius = Math.max(9, MARK_RADIUS_M * this.view.scale);
    for (const { colour, width } of [{ colour: this.paper, width: 5 }, { colour: MARK, width: 2.5 }]) {
      pen.setLineDash(isWhole ? [] : [4, 4]);
      pen.strokeStyle = pen.fillStyle = colour;
      pen.lineWidth = width;
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
      pen.stroke();
      pen.fillRect(x - width, y - width, 2 * width, 2 * width);
    }
    pen.setLineDash([]);
    pen.font = "bold 12px system-ui, sans-serif";
    this.write(pen, word, x + radius + 3, y + 4);
  }

  ring(pen, x, y, radius_m) {
    pen.beginPath();
    pen.arc(x, y, Math.max(1, radius_m * this.view.scale), 0, 2 * Math.PI);
    pen.stroke();
  }

  drawVehicle(pen, state, now_ms) {
    const isSilent = this.model.isSilent(state.id, now_ms);
    const [x, y] = this.toPixel(state.x, state.y);
    const size = this.size();
    const colour = isSilent ? "#8a8a8a" : css(this.model.colourOf(state.id), 1);
    pen.lineWidth = 1.5;
    pen.strokeStyle = colour;
    if (state.sd !== null) this.ring(pen, x, y, state.sd);
    pen.save();
    this.body(pen, x, y, state.heading);
    pen.fillStyle = colour;
    pen.strokeStyle = state.standsUnder === 1 ? "#c01020" : "#ffffff";
    pen.lineWidth = state.standsUnder === 1 ? 3 : 1.5;
    // Who is in another slice of altitude than what is shown is hollow.
    if (this.map.shows(state.z)) pen.fill();
    else pen.strokeStyle = colour;
    pen.stroke();
    pen.restore();
    pen.font = "bold 14px system-ui, sans-serif";
    const height = state.z >= ALOFT_M ? ` ↑${state.z.toFixed(1)} m` : "";
    this.write(pen, `${state.id}${isSilent ? " ?" : ""}${height}`, x + size + 2, y - size);
  }

  /** Text with a rim, so that it reads on anything. */
  write(pen, text, x, y) {
    pen.lineWidth = 3;
    pen.strokeStyle = this.paper;
    pen.lineJoin = "round";
    pen.strokeText(text, x, y);
    pen.fillStyle = this.ink;
    pen.fillText(text, x, y);
  }

  drawScale(pen) {
    const length_m = [0.5, 1, 2, 5, 10, 20, 50, 100].find((m) => m * this.view.scale >= 60) ?? 100;
    const low = this.canvas.clientHeight - 14;
    pen.fillStyle = this.ink;
    pen.fillRect(12, low, length_m * this.view.scale, 3);
    pen.font = "12px system-ui, sans-serif";
    this.write(pen, `${length_m} m`, 12, low - 6);
    const bearing = ((this.model.place.xAxis_deg ?? 90) * Math.PI) / 180;
    // North lies this far counter-clockwise from the x axis.
    const [nx, ny] = [Math.cos(bearing), Math.sin(bearing)];
    const [x, y] = [this.canvas.clientWidth - 26, 30];
    pen.strokeStyle = this.ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x - nx * 14, y + ny * 14); pen.lineTo(x + nx * 14, y - ny * 14);
    pen.stroke();
    this.write(pen, "N", x + nx * 20 - 4, y - ny * 20 + 4);
  }
}

/** The middle of the first two pointers, and how far they are apart; of a single one it is where that is. */
function between([[x0, y0], [x1, y1] = [x0, y0]]) {
  return { x: (x0 + x1) / 2, y: (y0 + y1) / 2, apart: Math.hypot(x1 - x0, y1 - y0) };
}
