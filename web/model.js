// The newest of everything that the feed has said, as plain values. Draws nothing.

/** @import * as told from "./told" */

import { KIND, PAIR, STATE, STRIPE, TILE } from "./frames.js";
import { bytesOf, readCells, readFrame, readRecord } from "./decode.js";

/** A vehicle whose state is older is silent. */
export const SILENT_AFTER_MS = 2000;
const UNKNOWN = 0xffff;
const NO_STRENGTH = -32768;
/** Strengths of one pair and events that are kept. */
const HISTORY_MOST = 600;
/** Strengths of a pair that are not further apart than this may be one. */
const SAME_MS = 300;
const EVENTS_MOST = 1000;
/** Nothing to wait for: how many tiles, and images of which subjects. */
const NOTHING = { tiles: 0, images: [] };
/** Places of a track that are kept, and how far they are apart at least. */
const TRACK_PLACES = 4000;
const TRACK_STEP_M = 0.05;

export class Model {
  constructor() {
    /** @type {told.Welcome} */
    this.place = null;
    this.changed = new Set();
    this.changedTiles = new Set();
    /** Counts how often all was forgotten. */
    this.generation = 0;
    /** @type {told.Moment} */
    this.moment = { at_s: 0, from_s: 0, to_s: 0, speed: null, isAnew: false, isWhole: true };
    /** @type {told.Marker[]} */
    this.markers = [];
    /** What was forgotten comes anew, and not all of it is there. */
    this.isFilling = false;
    /** What the server had of map and images when this page came. */
    this.awaited = NOTHING;
    this.heard_ms = -Infinity;
    this.shown_ms = 0;
    this.frames = 0;
    this.bytes = 0;
    this.texts = new Map();
    this.forget();
  }

  /** Forgets all that a board shows: another one comes. */
  forget() {
    this.generation += 1;
    this.states = new Map();
    /** @type {Map<number, told.ToldVehicle>} */
    this.vehicles = new Map();
    /** The ways that vehicles are committed to, without where they are. */
    /** @type {Map<number, [number, number][]>} */
    this.ways = new Map();
    /** @type {Map<number, told.ToldPlan>} */
    this.plans = new Map();
    /** @type {Map<number, told.ToldLook & { at_ms: number }>} */
    this.looks = new Map();
    this.tracks = new Map();
    this.tiles = new Map();
    this.images = new Map();
    /** @type {Map<number, told.ImageFinds>} */
    this.finds = new Map();
    /** @type {told.Ground & { at_ms: number }} */
    this.ground = null;
    this.pairs = new Map();
    this.history = new Map();
    /** The plans against time, and how far vehicles are in them; `timetable` is both, of one revision. */
    /** @type {told.ToldTimetable} */
    this.table = null;
    /** @type {told.ToldProgress} */
    this.progress = null;
    /** @type {told.ToldTimetable & { reached_s: number, rows: (told.TimetableRow & told.ProgressRow)[] }} */
    this.timetable = null;
    /** @type {(told.ToldEvent & { at: Date })[]} */
    this.events = [];
    /** @type {told.Marks} */
    this.marks = { marks: [], given: [] };
    /** @type {told.Orders} */
    this.orders = { isLinked: true, stops: [], orders: [], seat: null, lease: 0 };
    this.changedTiles.clear();
    this.texts.clear();
    for (const kind of Object.keys(KIND)) if (kind !== "Welcome") this.changed.add(kind.toLowerCase());
    this.changed.add("image");
  }

  /** A connection begins or is lost: the rest of a text that has begun does not come any more. */
  forgetParts() {
    this.texts.clear();
  }

  /** Takes a frame. */
  take(buffer, now_ms) {
    const frame = readFrame(buffer);
    this.heard_ms = now_ms;
    this.shown_ms = frame.time_s * 1000;
    this.frames += 1;
    this.bytes += buffer.byteLength;
    const at_ms = this.clock_ms(now_ms);
    switch (frame.kind) {
      case KIND.States: return this.takeStates(frame, at_ms);
      case KIND.Tiles: return this.takeTiles(frame);
      case KIND.Stripe: return this.takeStripe(frame);
      case KIND.Radio: return this.takePairs(frame, at_ms);
      default: return this.takeText(frame, at_ms);
    }
  }

  /** The clock by which ages are told: the browser's for a live swarm as it is now, otherwise the time that is shown. */
  clock_ms(now_ms) {
    return this.isLive() && this.isPresent() ? now_ms : this.shown_ms;
  }

  /** Whether there is a live swarm, as far as the server has said. */
  isLive() {
    return (this.place?.showing ?? "LIVE") === "LIVE";
  }

  /** Whether what is shown is the newest, not a moment that was asked for. */
  isPresent() {
    return this.moment.speed === null;
  }

  /** The date of a moment that is shown, in milliseconds: that of the browser's clock for a live swarm, otherwise the run's time. */
  date_ms(at_ms) {
    if (!this.isLive()) return at_ms;
    const newest_ms = this.isPresent() ? this.shown_ms : this.moment.to_s * 1000;
    return Date.now() - (newest_ms - at_ms);
  }

  /** A moment of the server as the time of day, local; that of a run is told as if it had begun at midnight. */
  timeText(at_ms) {
    return timeOfDay(new Date(this.date_ms(at_ms)), this.isLive());
  }

  takeStates(frame, now_ms) {
    let at = 0;
    for (let i = 0; i < frame.count; i++) {
      let record;
      [record, at] = readRecord(STATE, frame.body, at);
      const state = stateOf(record, now_ms);
      this.states.set(state.id, state);
      if (state.isPlaced) this.extendTrack(state);
      this.changed.add("states");
    }
  }

  extendTrack(state) {
    const track = this.tracks.get(state.id) ?? [];
    const last = track.at(-1);
    if (!last || Math.hypot(last[0] - state.x, last[1] - state.y) >= TRACK_STEP_M) track.push([state.x, state.y]);
    if (track.length > TRACK_PLACES) track.shift();
    this.tracks.set(state.id, track);
  }

  /** Where a vehicle has been until now, before what this page has seen itself. */
  takeTrack(/** @type {told.ToldTrack} */ { id, places_cm }) {
    const track = [];
    for (let i = 0; i < places_cm.length; i += 2) track.push([places_cm[i] / 100, places_cm[i + 1] / 100]);
    this.tracks.set(id, [...track, ...(this.tracks.get(id) ?? [])].slice(-TRACK_PLACES));
  }

  takeTiles(frame) {
    let at = 0;
    for (let i = 0; i < frame.count; i++) {
      let record;
      [record, at] = readRecord(TILE, frame.body, at);
      const key = `${record.slice}/${record.x}/${record.y}`;
      this.tiles.set(key, { ...record, cells: readCells(frame.body, at, record.bytes) });
      this.changedTiles.add(key);
      at += record.bytes;
    }
    this.changed.add("tiles");
  }

  takePairs(frame, now_ms) {
    let at = 0;
    for (let i = 0; i < frame.count; i++) {
      let record;
      [record, at] = readRecord(PAIR, frame.body, at);
      const key = `${record.receiver}-${record.transmitter}`;
      const pair = pairOf(record, now_ms);
      this.pairs.set(key, pair);
      const history = this.history.get(key) ?? [];
      history.push([pair.at_ms, pair.rssi]);
      if (history.length > HISTORY_MOST) history.shift();
      this.history.set(key, history);
    }
    this.changed.add("radio");
  }

  /** How strongly two vehicles heard each other before this page was told, as the server knows it; what came since stays. */
  takePairHistory(/** @type {number[]} */ [one, other], /** @type {told.ToldPairHistory} */ { at_s, there, back }, now_ms) {
    const at_ms = this.isLive() && this.isPresent() ? now_ms : at_s * 1000;
    /** @type {[string, told.ToldStrength[]][]} */
    const ways = [[`${one}-${other}`, there], [`${other}-${one}`, back]];
    for (const [key, strengths] of ways) {
      const before = strengths.map(({ age_s, rssi_dbm }) => [at_ms - age_s * 1000, rssi_dbm]);
      const last_ms = before.at(-1)?.[0] ?? -Infinity;
      // A strength that came both ways is a little apart from itself.
      const since = (this.history.get(key) ?? []).filter(([then_ms]) => then_ms > last_ms + SAME_MS);
      this.history.set(key, [...before, ...since].slice(-HISTORY_MOST));
    }
    this.changed.add("radio");
  }

  /** Events come once; a new connection brings all that are kept. Those of no live swarm have the run's time. */
  takeEvents(/** @type {told.ToldEvent[]} */ events) {
    for (const event of events) this.events.push({ ...event, at: new Date(this.date_ms(this.shown_ms - event.age_s * 1000)) });
    // Lines of logs are many: where they are more than half they go first.
    for (let more = this.events.length - EVENTS_MOST; more > 0; more--) {
      const notes = this.events.filter((event) => event.kind === "note").length;
      const goes = notes > EVENTS_MOST / 2 ? this.events.findIndex((event) => event.kind === "note") : 0;
      this.events.splice(goes, 1);
    }
  }

  /** A connection begins, perhaps to a server that was started anew. */
  takePlace(/** @type {told.Welcome} */ place) {
    this.forget();
    this.place = place;
    this.moment = { ...this.moment, speed: null };
    [this.markers, this.isFilling, this.awaited] = [[], false, place];
  }

  /** Which moment is shown; when all comes anew, what is known is forgotten. */
  takeMoment(/** @type {told.Moment} */ moment) {
    if (moment.isAnew) {
      this.forget();
      // Another moment comes as a whole.
      this.awaited = NOTHING;
    }
    this.moment = moment;
    this.isFilling = !moment.isWhole;
  }

  /** Whether vehicles are there, and all that the server had of the map and of images when this page came. */
  isWhole() {
    const { tiles, images } = this.awaited;
    const hasImage = (subject) => this.images.get(subject)?.mean.includes(NaN) === false;
    return this.states.size > 0 && !this.isFilling && this.tiles.size >= tiles && images.every(hasImage);
  }

  takeStripe(frame) {
    const [record, at] = readRecord(STRIPE, frame.body, 0);
    let image = this.images.get(record.subject);
    const isSame = image && image.run === record.run && image.sequence === record.sequence;
    if (!isSame) {
      const pixels = record.columns * record.rows;
      image = { ...record, mean: new Float32Array(pixels).fill(NaN), deviation: new Float32Array(pixels).fill(NaN) };
      this.images.set(record.subject, image);
    }
    const mean = new Int8Array(bytesOf(frame.body, at, record.pixels));
    for (let i = 0; i < record.pixels; i++) image.mean[record.first + i] = (mean[i] * record.meanStep_udb) / 1e6;
    if (record.hasDeviation) {
      const deviation = bytesOf(frame.body, at + record.pixels, record.pixels);
      for (let i = 0; i < record.pixels; i++) image.deviation[record.first + i] = (deviation[i] * record.deviationStep_udb) / 1e6;
    }
    image.version = (image.version ?? 0) + 1;
    this.changed.add("image");
  }

  /** Texts that do not fit into a frame come in several. */
  takeText(frame, now_ms) {
    const parts = this.texts.get(frame.kind) ?? [];
    parts.push(...bytesOf(frame.body));
    if (frame.goesOn) {
      this.texts.set(frame.kind, parts);
      return;
    }
    this.texts.delete(frame.kind);
    const value = JSON.parse(new TextDecoder().decode(new Uint8Array(parts)));
    switch (frame.kind) {
      case KIND.Welcome: this.takePlace(value); break;
      case KIND.Orders: this.orders = value; break;
      case KIND.Ground: this.ground = { ...value, at_ms: now_ms - (value.age_s ?? 0) * 1000 }; break;
      case KIND.Vehicle: this.vehicles.set(value.id, value); break;
      case KIND.Way: this.ways.set(value.id, value.ahead); break;
      case KIND.Plan: this.plans.set(value.id, value); break;
      case KIND.Track: this.takeTrack(value); break;
      case KIND.Look: this.looks.set(value.id, { ...value, at_ms: now_ms }); break;
      case KIND.Finds: this.finds.set(value.subject, value); break;
      case KIND.Marks: this.marks = value; break;
      case KIND.Timetable: this.takeTimetable(value, this.progress); break;
      case KIND.Progress: this.takeTimetable(this.table, value); break;
      case KIND.Events: this.takeEvents(value.events); break;
      case KIND.Moment: this.takeMoment(value); break;
      case KIND.Markers: this.markers = [...this.markers, ...value.markers].slice(-EVENTS_MOST); break;
      default: return;
    }
    const names = Object.entries(KIND).find(([, number]) => number === frame.kind);
    this.changed.add(names[0].toLowerCase());
  }

  /** The plans against time with how far vehicles are in them, as far as that is of the same plans. */
  takeTimetable(/** @type {told.ToldTimetable} */ table, /** @type {told.ToldProgress} */ progress) {
    [this.table, this.progress] = [table, progress];
    const isOfIt = table && progress && table.run === progress.run && table.revision === progress.revision;
    const said = new Map((isOfIt ? progress.rows : []).map((row) => [row.vehicle, row]));
    const unsaid = { isFollowed: false, done: null, leg: null, waitsFor: [] };
    const rows = (table?.rows ?? []).map((row) => ({ ...row, ...(said.get(row.vehicle) ?? unsaid) }));
    this.timetable = table && { ...table, reached_s: isOfIt ? progress.reached_s : 0, rows };
  }

  /** The way that a vehicle is committed to, from where it is; empty = none. */
  legOf(id) {
    const [state, ahead] = [this.states.get(id), this.ways.get(id)];
    return state && ahead ? [[state.x, state.y], ...ahead] : [];
  }

  /** Numbers of all vehicles, ascending. */
  ids() {
    return [...new Set([...this.states.keys(), ...this.vehicles.keys()])].sort((a, b) => a - b);
  }

  isSilent(id, now_ms) {
    const state = this.states.get(id);
    return !state || now_ms - state.at_ms > SILENT_AFTER_MS;
  }

  colourOf(id) {
    const colours = this.place?.vehicleColours ?? [[90, 90, 90]];
    return colours[(id + colours.length - 1) % colours.length];
  }
}

function pairOf(record, now_ms) {
  return {
    receiver: record.receiver,
    transmitter: record.transmitter,
    rssi: record.rssi_dbm === NO_STRENGTH ? null : record.rssi_dbm,
    loss: record.loss_permille / 1000,
    excess: record.excess_ddb === NO_STRENGTH ? null : record.excess_ddb / 10,
    distance: record.distance_mm / 1000,
    at_ms: now_ms - record.age_ms,
  };
}

function stateOf(record, now_ms) {
  const has = (bit) => (record.flags & (1 << bit)) !== 0;
  return {
    id: record.vehicle,
    mode: record.mode,
    standsUnder: record.standsUnder,
    isPlaced: has(0),
    isAtRest: has(1),
    isArmed: has(2),
    isLanded: has(3),
    isForeign: has(4),
    x: record.x_mm / 1000,
    y: record.y_mm / 1000,
    z: record.z_mm / 1000,
    heading: record.heading_urad100 / 1e4,
    sd: record.sd_mm === UNKNOWN ? null : record.sd_mm / 1000,
    speed: record.speed_mmps / 1000,
    battery: record.battery_permille === UNKNOWN ? null : record.battery_permille / 1000,
    waiting: record.waiting === UNKNOWN ? null : record.waiting,
    at_ms: now_ms - record.age_ms,
  };
}

/** A date as the time of day; of no live swarm, in the time of the run. */
export function timeOfDay(date, isLive) {
  const form = { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" };
  return date.toLocaleTimeString([], isLive ? form : { ...form, timeZone: "UTC" });
}
