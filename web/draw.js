// What both views of the scene draw alike: the colours of cells and of excess losses, and what a cell is.

/** @import { Model } from "./model.js" */

export const SIDE = 32;
export const OCCUPIED_FROM = 9;
export const FREE_TO = -8;
const SURE = 17;
/** What truly stands there, in a simulation. */
export const TRUTH = "#a03cc8";
/** An excess loss of this much is as dark as it gets, dB. */
const EXCESS_MOST_DB = 20;

/** Free is light, occupied is dark; what is not known lets the paper through. */
export function cellColour(value) {
  if (value >= OCCUPIED_FROM) return [16, 16, 22, 255];
  if (value <= FREE_TO) {
    const share = Math.min(1, -value / SURE);
    return [246, 247, 249, Math.round(140 + 115 * share)];
  }
  return [0, 0, 0, 0];
}

/** A loss beyond the path loss: from teal (none) over ochre to crimson; what is not known is grey. */
export function excessColour(excess_db) {
  if (excess_db === null) return [120, 120, 128];
  const share = Math.min(1, Math.max(0, excess_db / EXCESS_MOST_DB));
  const [from, to, part] = share < 0.5 ? [[0, 135, 125], [205, 150, 0], share * 2] : [[205, 150, 0], [185, 10, 50], share * 2 - 1];
  return from.map((channel, i) => Math.round(channel + (to[i] - channel) * part));
}

/** A colour as style sheets have it. @param {number[]} colour */
export function css(colour, share) {
  const [red, green, blue] = colour;
  return `rgba(${red}, ${green}, ${blue}, ${share})`;
}

/** The pairs that are heard, each way once, between vehicles whose places are known: both ends, and the greater excess. */
export function liveLinks(/** @type {Model} */ model, now_ms, newest_ms = 5000) {
  const links = new Map();
  for (const pair of model.pairs.values()) {
    const [one, other] = [model.states.get(pair.receiver), model.states.get(pair.transmitter)];
    if (!one?.isPlaced || !other?.isPlaced || now_ms - pair.at_ms > newest_ms) continue;
    const key = `${Math.min(pair.receiver, pair.transmitter)}-${Math.max(pair.receiver, pair.transmitter)}`;
    const known = links.get(key)?.excess_db ?? null;
    const excess_db = known === null || (pair.excess !== null && pair.excess > known) ? pair.excess : known;
    links.set(key, { from: one, to: other, excess_db });
  }
  return [...links.values()];
}

/** The border of a find's ellipse of one standard deviation, closed; of one whose deviation is not known a ring of no meaning. */
export function ellipsePlaces({ at, sd_m, ellipse }, unknown_m = 0.3) {
  const { major_m, minor_m, angle_rad } = ellipse ?? { major_m: sd_m ?? unknown_m, minor_m: sd_m ?? unknown_m, angle_rad: 0 };
  const [cos, sin] = [Math.cos(angle_rad), Math.sin(angle_rad)];
  return Array.from({ length: 49 }, (_, i) => {
    const [along, across] = [major_m * Math.cos((i * Math.PI) / 24), minor_m * Math.sin((i * Math.PI) / 24)];
    return [at[0] + along * cos - across * sin, at[1] + along * sin + across * cos];
  });
}
