// Another run beside the one that is shown: where its vehicles were at the same time of the run, and how they came there. Both runs
// lie over each other from their first starts on, which the server has reckoned in. Loaded once, when the server says that there is one.

/** @import { Model } from "./model.js" */
/** @import { ToldGhost } from "./told" */

import { ANSWERED_WITHIN_MS } from "./pace.js";

const NUMBERS = 5;
/** Between poses that are further apart in time nobody knows where a vehicle was, seconds. */
const GAP_S = 30;

export class Ghost {
  /** `wanted` is told when it has come. */
  constructor(/** @type {Model} */ model, token, wanted) {
    this.model = model;
    this.token = token;
    this.wanted = wanted;
    this.ways = null;
  }

  isThere() {
    return Boolean(this.model.place?.ghost);
  }

  /** Where its vehicles are at the moment that is shown, each with the way until then. */
  vehicles() {
    if (!this.isThere()) return [];
    if (this.ways === null) this.load();
    return this.ways.map(({ id, poses }) => at(id, poses, this.model.shown_ms / 1000)).filter(Boolean);
  }

  async load() {
    this.ways = [];
    try {
      const answer = await fetch("ghost", { headers: { Authorization: `Bearer ${this.token}` }, signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
      /** @type {ToldGhost} */
      const told = answer.ok ? await answer.json() : { name: "", vehicles: [] };
      this.ways = told.vehicles.map(({ vehicle, poses }) => ({ id: vehicle, poses: unpacked(poses) }));
      this.wanted();
    } catch {
      // The next connection brings it.
      this.ways = null;
    }
  }
}

function unpacked(numbers) {
  const poses = [];
  for (let i = 0; i + NUMBERS <= numbers.length; i += NUMBERS) {
    const [tenths, x, y, z, heading] = numbers.slice(i, i + NUMBERS);
    poses.push({ at_s: tenths / 10, x: x / 100, y: y / 100, z: z / 100, heading: heading / 100 });
  }
  return poses;
}

function at(id, poses, at_s) {
  let [low, high] = [0, poses.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (poses[middle].at_s <= at_s) low = middle + 1;
    else high = middle;
  }
  if (low === 0) return null;
  const [before, next] = [poses[low - 1], poses[low]];
  const isBetween = next && next.at_s - before.at_s < GAP_S;
  const share = isBetween ? (at_s - before.at_s) / Math.max(1e-3, next.at_s - before.at_s) : 0;
  const between = (axis) => before[axis] + share * (isBetween ? next[axis] - before[axis] : 0);
  const pose = { x: between("x"), y: between("y"), z: between("z"), heading: before.heading };
  // After its end it stays where it was, and says so.
  return { id, ...pose, isOver: !next, track: [...poses.slice(0, low).map(({ x, y }) => [x, y]), [pose.x, pose.y]] };
}
