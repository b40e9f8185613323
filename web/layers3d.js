// What stands in the scene in three dimensions, layer by layer: each is made anew when what it shows has changed, and not before.
// The layers that are switched on are those of the view from above.

/** @import { Model } from "./model.js" */
/** @import { SceneMesh } from "./told" */

import { css, ellipsePlaces, excessColour, liveLinks, OCCUPIED_FROM, SIDE } from "./draw.js";
import { imageCanvas } from "./image.js";
import { Labels } from "./labels3d.js";
import { MARK, MARK_RADIUS_M, marksOf } from "./marks.js";
import { ANSWERED_WITHIN_MS } from "./pace.js";
import { waitsOf } from "./plan.js";
import { vehicleParts } from "./vehicle3d.js";
import {
  BoxGeometry, BufferGeometry, CanvasTexture, DoubleSide, Float32BufferAttribute, Group, InstancedMesh, Line, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, NearestFilter, PlaneGeometry, SRGBColorSpace,
} from "./vendor/three.js";

/** How high occupied cells are drawn; nobody knows how high they are. */
const WALL_M = 0.4;
const WALLS_EVERY_MS = 1000;
const WALLS_MOST = 60000;
/** A vehicle is drawn this much larger for each metre of distance, so that it is seen. */
const LARGER_PER_M = 0.06;
/** What was heard longer ago is not shown. */
const LOOK_LASTS_MS = 2000;
/** Where a reading has its age, in seconds. */
const AGE = 5;
const TRUTH = 0xa03cc8;
const FIND = 0x0a7a3a;
/**
 * Tiles this near to what the place names are drawn, metres: all of them are one canvas, and a single tile of a vehicle that is
 * wrong about its place would make it so large that the browser has no memory left.
 */
const MAP_MARGIN_M = 30;
/** As high as a person. */
const MARK_M = 1.7;
/** Heights of what lies flat, so that nothing flickers. */
const Z = { map: 0, image: 0.05, area: 0.02, track: 0.07, plan: 0.09, link: 0.3, ring: 0.06 };

export class Layers {
  constructor(/** @type {Model} */ model, plane, scene, token, wanted) {
    this.model = model;
    this.plane = plane;
    this.scene = scene;
    this.token = token;
    this.wanted = wanted;
    this.groups = new Map();
    this.keys = new Map();
    this.labels = new Labels(scene);
    this.mesh = null;
    this.walls_ms = -Infinity;
  }

  /** Everything is to be made anew. */
  forget() {
    this.keys.clear();
    this.labels.forget();
  }

  /** A layer of a name: made when it is shown and its key is another one than before. */
  layer(name, isShown, key, make) {
    let group = this.groups.get(name);
    if (!group) {
      group = new Group();
      group.name = name;
      this.groups.set(name, group);
      this.scene.add(group);
    }
    group.visible = isShown;
    if (!isShown || this.keys.get(name) === key) return;
    this.keys.set(name, key);
    for (const child of [...group.children]) dispose(child);
    group.clear();
    const made = make();
    if (made.length > 0) group.add(...made);
  }

  update(now_ms, { riding, height, camera }) {
    const { model, plane } = this;
    const on = (name) => plane.layers[name].checked;
    const style = getComputedStyle(plane.canvas.parentElement);
    this.ink = style.getPropertyValue("--ink").trim();
    this.paper = style.getPropertyValue("--paper").trim();
    this.labels.begin(this.ink, this.paper, height);
    plane.map.take();
    const theme = this.ink + this.paper;
    // Seen from far away, what is thin or small is drawn larger.
    this.width = riding === null ? Math.max(0.05, Math.round(camera.position.z * 0.6) / 100) : 0.02;
    this.layer("place", true, `${model.place.venue} ${theme}`, () => this.place());
    if (riding === null) model.place.homes.forEach(([x, y], index) => this.labels.put(`home ${index + 1}`, x + 0.4, y - 0.4, 0.05, 11));
    this.layer("map", on("map"), `${plane.map.version} ${model.generation}`, () => this.map());
    this.showWalls(on("map"));
    this.showImage(on("image"));
    this.showLinks(on("links"), now_ms);
    this.showWays(on("tracks"), on("plan"));
    this.showWaits(on("plan"));
    this.showGhost(on("ghost"));
    this.showFinds();
    this.showMarks();
    this.showTruth(on("truth"));
    this.showWhy();
    this.layer("sketch", plane.sketch.length > 0, JSON.stringify(plane.sketch), () => [line(plane.sketch.map(([x, y]) => [x, y, 0.1]), this.ink)]);
    this.showCell();
    this.showVehicles(now_ms, riding, camera);
    this.labels.end();
  }

  place() {
    const { fence, area } = this.model.place;
    const [[x0, y0], [x1, y1]] = area;
    const closed = (places, z) => [...places, places[0]].map(([x, y]) => [x, y, z]);
    const posts = fence.flatMap(([x, y]) => [[x, y, 0], [x, y, 0.5]]);
    const border = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    const homes = this.model.place.homes.map(([x, y]) => {
      const side = [[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]].map(([dx, dy]) => [x + dx, y + dy]);
      return line(closed(side, Z.area), this.ink);
    });
    return [
      line(closed(fence, 0.02), this.ink), line(closed(fence, 0.5), this.ink), segments(posts, this.ink),
      line(closed(border, Z.area), this.ink, 0.6), ...homes,
    ];
  }

  /** All tiles that are shown, and are not far from the place, as one texture. */
  map() {
    const side = SIDE * this.model.place.cell_m;
    const tiles = this.plane.map.shown().filter(nearTo(this.model.place, side));
    if (tiles.length === 0) return [];
    const [xs, ys] = [tiles.map(({ tile }) => tile.x), tiles.map(({ tile }) => tile.y)];
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs) + 1, Math.min(...ys), Math.max(...ys) + 1];
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [(right - left) * SIDE, (high - low) * SIDE];
    const pen = canvas.getContext("2d");
    for (const { tile, picture } of tiles) pen.drawImage(picture, (tile.x - left) * SIDE, (high - 1 - tile.y) * SIDE);
    return [sheet(canvas, [left * side, low * side, right * side, high * side], Z.map, 1)];
  }

  /** Occupied cells, side by side as one box, raised. */
  showWalls(isShown) {
    const key = `${this.plane.map.version} ${this.model.generation}`;
    if (isShown && this.keys.get("walls") !== key) {
      // A wall may come a second late; a map that grows makes no thousand boxes ten times a second.
      const wait_ms = this.walls_ms + WALLS_EVERY_MS - performance.now();
      if (wait_ms > 0) {
        setTimeout(this.wanted, wait_ms + 20);
        return;
      }
      this.walls_ms = performance.now();
    }
    this.layer("walls", isShown, key, () => this.walls());
  }

  walls() {
    const cell = this.model.place.cell_m;
    const boxes = [];
    for (const { tile } of this.plane.map.ofSlices()) {
      const [low, high] = this.plane.map.bordersOf(tile.slice) ?? [0, WALL_M];
      for (let row = 0; row < SIDE; row++) {
        let from = -1;
        for (let column = 0; column <= SIDE; column++) {
          const isWall = column < SIDE && tile.cells[row * SIDE + column] >= OCCUPIED_FROM;
          if (isWall && from < 0) from = column;
          if (isWall || from < 0) continue;
          boxes.push([tile.x * SIDE + from, tile.y * SIDE + row, column - from, low, Math.min(WALL_M, high - low)]);
          from = -1;
        }
      }
    }
    const count = Math.min(boxes.length, WALLS_MOST);
    if (count === 0) return [];
    const mesh = new InstancedMesh(new BoxGeometry(1, 1, 1), new MeshLambertMaterial({ color: 0x3d4254 }), count);
    const at = new Matrix4();
    for (let i = 0; i < count; i++) {
      const [x, y, length, low, height] = boxes[i];
      at.makeScale(length * cell, cell, height).setPosition((x + length / 2) * cell, (y + 0.5) * cell, low + height / 2);
      mesh.setMatrixAt(i, at);
    }
    return [mesh];
  }

  subject() {
    return Number(document.getElementById("image-subject").value);
  }

  showImage(isShown) {
    const image = this.model.images.get(this.subject());
    const key = image ? `${image.subject} ${image.run} ${image.sequence} ${image.version}` : "none";
    this.layer("image", isShown && Boolean(image), key, () => {
      const border = [image.least_x_mm, image.least_y_mm, image.greatest_x_mm, image.greatest_y_mm].map((mm) => mm / 1000);
      return [sheet(imageCanvas(this.model, image, "mean", true), border, Z.image, 1)];
    });
  }

  showLinks(isShown, now_ms) {
    const links = isShown ? liveLinks(this.model, now_ms) : [];
    const key = this.width + links.map(({ from, to, excess_db }) => `${from.id} ${from.x} ${from.y} ${to.id} ${to.x} ${to.y} ${excess_db}`).join();
    this.layer("links", isShown, key, () => links.map(({ from, to, excess_db }) => {
      const ends = [[from.x, from.y, from.z + Z.link], [to.x, to.y, to.z + Z.link]];
      return ribbon(ends, css(excessColour(excess_db), 1), this.width);
    }));
    for (const { from, to, excess_db } of links) {
      const text = excess_db === null ? "not heard" : `${excess_db.toFixed(0)} dB`;
      this.labels.put(text, (from.x + to.x) / 2, (from.y + to.y) / 2, (from.z + to.z) / 2 + Z.link + 0.1, 11);
    }
  }

  showWays(hasTracks, hasPlans) {
    const { model } = this;
    const ids = [...new Set([...model.tracks.keys(), ...model.plans.keys()])];
    for (const id of ids) {
      const colour = css(model.colourOf(id), 1);
      const track = model.tracks.get(id) ?? [];
      this.layer(`track ${id}`, hasTracks && track.length > 1, `${track.length} ${track[0]} ${track.at(-1)}`, () => [
        line(track.map(([x, y]) => [x, y, Z.track]), colour, 0.8),
      ]);
      const plan = model.plans.get(id);
      const vehicle = model.vehicles.get(id);
      const isFollowed = plan && vehicle?.run === plan.run && vehicle?.mission?.end == null;
      this.layer(`plan ${id}`, hasPlans && Boolean(isFollowed), plan ? `${plan.run} ${plan.revision}` : "", () => {
        const way = [plan.start, ...plan.stops.flatMap((stop) => [...stop.route, stop.at])];
        return [line(way.map(([x, y]) => [x, y, Z.plan]), colour, 0.5)];
      });
      const leg = model.legOf(id);
      this.layer(`leg ${id}`, hasPlans && leg.length > 1, this.width + JSON.stringify(leg), () => [ribbon(leg.map(([x, y]) => [x, y, Z.plan]), colour, this.width)]);
    }
    const known = new Set(ids.map(String));
    for (const [name, group] of this.groups) {
      const [kind, id] = name.split(" ");
      if (id !== undefined && ["track", "plan", "leg"].includes(kind) && !known.has(id)) group.visible = false;
    }
  }

  /** Where the vehicles of another run were then: outlines without a body. */
  showGhost(isShown) {
    const vehicles = isShown ? this.plane.ghost?.vehicles() ?? [] : [];
    const key = this.width + vehicles.map(({ id, x, y, z, heading, track }) => [id, x, y, z, heading, track.length].join()).join(";");
    this.layer("ghost", vehicles.length > 0, key, () => vehicles.flatMap(({ id, x, y, z, heading, track }) => {
      const color = css(this.model.colourOf(id), 1);
      const size = 0.3 + 2 * this.width;
      const corner = ([ahead, left]) => [x + size * (ahead * Math.cos(heading) - left * Math.sin(heading)), y + size * (ahead * Math.sin(heading) + left * Math.cos(heading))];
      const outline = [[1, 0], [-0.75, 0.7], [-0.4, 0], [-0.75, -0.7], [1, 0]].map(corner);
      return [line(track.map((at) => [...at, Z.track]), color, 0.4), ...[z + 0.05, z + 0.25].map((height) => line(outline.map((at) => [...at, height]), color, 0.7))];
    }));
    for (const { id, x, y, z, isOver } of vehicles) this.labels.put(`ghost ${id}${isOver ? ", over" : ""}`, x, y, z + 0.6, 11);
  }

  /** Who waits, and for whom. */
  showWaits(isShown) {
    const waits = isShown ? waitsOf(this.model.timetable?.rows ?? []) : [];
    const placed = waits.map(({ vehicle, of }) => [vehicle, of, this.model.states.get(vehicle), this.model.states.get(of)])
      .filter(([, , one, other]) => one?.isPlaced && other?.isPlaced);
    const key = placed.map(([, , one, other]) => [one.x, one.y, other.x, other.y].join()).join(";");
    this.layer("waits", isShown, key, () => placed.map(([, , one, other]) => line([[one.x, one.y, 0.2], [other.x, other.y, 0.2]], this.ink)));
    for (const [vehicle, of, one, other] of placed) {
      this.labels.put(`${vehicle} waits for ${of}`, one.x + (other.x - one.x) * 0.3, one.y + (other.y - one.y) * 0.3, 0.3, 11);
    }
  }

  showFinds() {
    const finds = this.model.finds.get(this.subject())?.finds ?? [];
    this.layer("finds", finds.length > 0, JSON.stringify(finds), () => finds.flatMap((find) => [
      ribbon([[...find.at, 0], [...find.at, 1.9]], "#0a7a3a", 0.08), line(ellipsePlaces(find).map((place) => [...place, Z.ring]), FIND),
    ]));
    for (const { at, sd_m } of finds) this.labels.put(sd_m === null ? "find" : `find ± ${sd_m.toFixed(2)} m`, at[0], at[1], 2.1, 12);
  }

  /** Where somebody truly stands: a post with a ring on the ground and one at its head; of what is not stored every other part is missing. */
  showMarks() {
    const marks = marksOf(this.model, this.plane.candidate);
    this.layer("marks", marks.length > 0, this.width + JSON.stringify(marks), () => marks.flatMap(({ at: [x, y], isStored }) => [
      ...[[0, 0.4], [0.8, 1.2], ...(isStored ? [[0.4, 0.8], [1.2, MARK_M]] : [])].map(([low, high]) => ribbon([[x, y, low], [x, y, high]], MARK, Math.max(0.06, this.width))),
      ...[Z.ring, MARK_M].map((z) => ringParts(x, y, z, MARK_RADIUS_M, MARK, isStored)),
    ]));
    for (const { at: [x, y], word } of marks) this.labels.put(word, x, y, MARK_M + 0.2, 12);
  }

  /** What truly stands in a simulation: the triangles that its sensors hear. They come when they are asked for first. */
  showTruth(isShown) {
    if (isShown && this.mesh === null) {
      this.mesh = [];
      this.load().then((objects) => { this.mesh = objects; this.wanted(); }, () => {});
    }
    this.layer("truth", isShown, `${this.mesh?.length}`, () => (this.mesh ?? []).map(body));
    for (const person of isShown ? this.model.place.truth?.persons ?? [] : []) this.labels.put(person.name, person.at[0], person.at[1], 2.0, 12);
  }

  async load() {
    const answer = await fetch("mesh", { headers: { Authorization: `Bearer ${this.token}` }, signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
    /** @type {SceneMesh} */
    const told = answer.ok ? await answer.json() : { objects: [] };
    return told.objects;
  }

  /** The links that made a pixel, by what each adds to it. */
  showWhy() {
    const lines = this.plane.why?.lines ?? [];
    this.layer("why", lines.length > 0, this.plane.why, () => lines.map(({ from, to, colour, share }) => (
      ribbon([[...from, Z.link], [...to, Z.link]], css(colour, 1), whyWidth_m(share))
    )));
  }

  /** The cell of which is told who has seen it. */
  showCell() {
    const { cell } = this.plane;
    this.layer("cell", cell !== null, `${cell} ${this.ink}`, () => {
      const half = Math.max(0.1, this.model.place.cell_m / 2);
      const corners = [[-half, -half], [half, -half], [half, half], [-half, half], [-half, -half]];
      return [Z.ring, WALL_M + 0.02].map((z) => line(corners.map(([dx, dy]) => [cell[0] + dx, cell[1] + dy, z]), this.ink));
    });
  }

  /** What the sensors of a vehicle heard, unless that is long ago. */
  lookOf(id, now_ms) {
    const look = this.model.looks.get(id);
    if (!look || now_ms - look.at_ms >= LOOK_LASTS_MS) return null;
    const readings = look.readings.filter((reading) => reading[AGE] * 1000 + now_ms - look.at_ms < LOOK_LASTS_MS);
    return { ...look, readings };
  }

  showVehicles(now_ms, riding, camera) {
    for (const [name, group] of this.groups) if (name.startsWith("vehicle ")) group.visible = false;
    for (const state of this.model.states.values()) {
      if (!state.isPlaced) continue;
      const isSilent = this.model.isSilent(state.id, now_ms);
      const isRidden = state.id === riding;
      const colour = isSilent ? [138, 138, 138] : this.model.colourOf(state.id);
      const look = isRidden ? this.lookOf(state.id, now_ms) : null;
      // Only the cones of a ride follow what is heard, or the map.
      const version = look ? `${look.at_ms} ${look.readings.length}` : isRidden ? this.plane.map.version : "";
      const key = [state.x, state.y, state.z, state.heading, state.sd, state.standsUnder, colour, isRidden, version].join();
      const of = { state, colour, isRidden, look, sensors: this.model.place.sensors, cellWord: (x, y) => this.plane.cellWord(x, y) };
      this.layer(`vehicle ${state.id}`, true, key, () => vehicleParts(of));
      const [shape] = this.groups.get(`vehicle ${state.id}`).children;
      const scale = isRidden ? 1 : Math.max(1, camera.position.distanceTo(shape.position) * LARGER_PER_M);
      shape.scale.setScalar(scale);
      if (!isRidden) this.labels.put(isSilent ? `${state.id} ?` : String(state.id), state.x, state.y, state.z + 0.55 * scale, 15);
      else for (const { text, at } of this.groups.get(`vehicle ${state.id}`).children[0]?.userData.echoes ?? []) this.labels.put(text, ...at, 12);
    }
  }
}

/** How thick a link is drawn that adds a share of what the strongest adds: from 2 cm to 10 cm. */
export function whyWidth_m(share) {
  return 0.02 + 0.08 * share;
}

/** Whether a tile lies within the margin about all that the place names; the side of a tile is in metres. */
function nearTo({ fence, area, homes }, side) {
  const [xs, ys] = [0, 1].map((axis) => [...fence, ...area, ...homes].map((at) => at[axis]));
  const isWithin = (index, along) => {
    return (index + 1) * side >= Math.min(...along) - MAP_MARGIN_M && index * side <= Math.max(...along) + MAP_MARGIN_M;
  };
  return ({ tile }) => isWithin(tile.x, xs) && isWithin(tile.y, ys);
}

/** Frees what an object and all in it hold on the graphics card. */
function dispose(object) {
  object.traverse((part) => {
    part.geometry?.dispose();
    part.material?.map?.dispose();
    part.material?.dispose();
    part.dispose?.();
  });
}

/** A canvas that lies flat, north up, within a border of x0, y0, x1, y1. @param {number[]} border */
function sheet(canvas, border, z, opacity) {
  const [x0, y0, x1, y1] = border;
  const map = new CanvasTexture(canvas);
  map.magFilter = map.minFilter = NearestFilter;
  map.generateMipmaps = false;
  map.colorSpace = SRGBColorSpace;
  const material = new MeshBasicMaterial({ map, transparent: true, opacity, depthWrite: false });
  const mesh = new Mesh(new PlaneGeometry(x1 - x0, y1 - y0), material);
  mesh.position.set((x0 + x1) / 2, (y0 + y1) / 2, z);
  mesh.renderOrder = z;
  return mesh;
}

function geometry(places) {
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(places.flat(), 3));
}

function line(places, color, opacity = 1) {
  return new Line(geometry(places), new LineBasicMaterial({ color, transparent: opacity < 1, opacity }));
}

function segments(places, color) {
  return new LineSegments(geometry(places), new LineBasicMaterial({ color }));
}

/** A ring that lies flat, whole or broken. */
function ringParts(x, y, z, radius, color, isWhole) {
  const corner = (i) => [x + radius * Math.cos((i * Math.PI) / 12), y + radius * Math.sin((i * Math.PI) / 12), z];
  const parts = Array.from({ length: 24 }, (_, i) => i).filter((i) => isWhole || i % 2 === 0);
  return segments(parts.flatMap((i) => [corner(i), corner(i + 1)]), color);
}

/** A line of a thickness in metres: thicker ones are not drawn everywhere. */
function ribbon(places, color, width) {
  const corners = [];
  for (let i = 1; i < places.length; i++) {
    const [[ax, ay, az], [bx, by, bz]] = [places[i - 1], places[i]];
    const length = Math.hypot(bx - ax, by - ay);
    const [nx, ny, nz] = length > 1e-6 ? [(-(by - ay) / length) * width / 2, ((bx - ax) / length) * width / 2, 0] : [width / 2, 0, 0];
    const [a, b, c, d] = [[ax + nx, ay + ny, az + nz], [ax - nx, ay - ny, az - nz], [bx + nx, by + ny, bz], [bx - nx, by - ny, bz]];
    corners.push(a, b, c, c, b, d);
    // Seen from the side it is a ribbon as well.
    const up = [[ax, ay, az - width / 2], [ax, ay, az + width / 2], [bx, by, bz - width / 2], [bx, by, bz + width / 2]];
    corners.push(up[0], up[1], up[2], up[2], up[1], up[3]);
  }
  return new Mesh(geometry(corners), new MeshBasicMaterial({ color, side: DoubleSide }));
}

/** An object of the scene. */
function body({ corners_mm, triangles }) {
  const made = new BufferGeometry();
  made.setAttribute("position", new Float32BufferAttribute(corners_mm.map((mm) => mm / 1000), 3));
  made.setIndex(triangles);
  const flat = made.toNonIndexed();
  flat.computeVertexNormals();
  return new Mesh(flat, new MeshLambertMaterial({ color: TRUTH, transparent: true, opacity: 0.5, side: DoubleSide }));
}
