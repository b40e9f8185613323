// A vehicle in three dimensions: its body, how sure its place is, and with whom one rides also the cones of its range sensors: those
// of its last readings, where it says them. In a simulation nobody does: there a cone reaches as far as the merged map is not occupied
// along its axis, which is where an echo would come from, by the map.

import { BoxGeometry, BufferGeometry, ConeGeometry, DoubleSide, Float32BufferAttribute, Group, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, MeshLambertMaterial } from "./vendor/three.js";

const STEP_M = 0.05;
/** How high a sensor is drawn of which that is not known. */
const SENSOR_HEIGHT_M = 0.2;
const STOPPED = 1;
const ARC_PARTS = 6;
/** Echoes that are told in words at most: the nearest. */
const ECHOES_MOST = 5;

/** The parts of a vehicle; `userData.echoes` of the first says what its sensors would hear. */
export function vehicleParts({ state, colour, isRidden, look, sensors, cellWord }) {
  const [red, green, blue] = colour;
  const color = `rgb(${red}, ${green}, ${blue})`;
  const group = new Group();
  group.position.set(state.x, state.y, state.z);
  group.rotation.z = state.heading;
  group.userData.echoes = [];
  const body = new Mesh(new BoxGeometry(0.4, 0.3, 0.14), new MeshLambertMaterial({ color }));
  body.position.z = 0.1;
  const nose = new Mesh(new ConeGeometry(0.13, 0.34, 12), new MeshLambertMaterial({ color: state.standsUnder === STOPPED ? 0xc01020 : color }));
  nose.rotation.z = -Math.PI / 2;
  nose.position.set(0.22, 0, 0.22);
  // Who rides sees the bonnet and no more.
  if (!isRidden) group.add(nose);
  group.add(body);
  const parts = [group];
  if (state.sd !== null && state.sd > 0) parts.push(ring(state, color));
  if (isRidden && look) parts.push(...heardCones(look, sensors?.height_m ?? SENSOR_HEIGHT_M, group.userData.echoes));
  else if (isRidden && sensors) parts.push(...cones(state, sensors, cellWord, group.userData.echoes));
  return parts;
}

function ring(state, color) {
  const places = Array.from({ length: 49 }, (_, i) => [Math.cos((i * Math.PI) / 24), Math.sin((i * Math.PI) / 24)]);
  const corners = places.flatMap(([x, y]) => [state.x + x * state.sd, state.y + y * state.sd, 0.06]);
  return new Line(shape(corners), new LineBasicMaterial({ color }));
}

/** The cones of what was heard, from where it was heard; echoes that nothing has confirmed yet are paler. */
function heardCones({ readings, halfAngle_rad, maxRange_m }, height_m, echoes) {
  const [free, hits, doubtful] = [[], [], []];
  const of = { half_angle_rad: halfAngle_rad, height_m };
  for (const [x, y, z, towards, echo_m, , isSuspect] of readings) {
    const range_m = echo_m ?? maxRange_m;
    free.push(...sector({ x, y, z }, of, towards, 0, range_m));
    if (echo_m === null) continue;
    (isSuspect ? doubtful : hits).push(...sector({ x, y, z }, of, towards, Math.max(0, range_m - 0.06), range_m + 0.02));
    const at = [x + range_m * Math.cos(towards), y + range_m * Math.sin(towards), z + height_m + 0.25];
    echoes.push({ text: `${range_m.toFixed(1)} m${isSuspect ? " ?" : ""}`, at, range_m });
  }
  nearest(echoes);
  return [fill(free, 0x0b8fd9, 0.13), fill(hits, 0xd9480f, 0.95), fill(doubtful, 0xd9480f, 0.4)];
}

function nearest(echoes) {
  echoes.sort((one, other) => one.range_m - other.range_m).splice(ECHOES_MOST);
}

function cones(state, sensors, cellWord, echoes) {
  const free = [];
  const hits = [];
  for (const beam of sensors.beams_rad) {
    const towards = state.heading + beam;
    const [range_m, isEcho] = rangeOf(state, towards, sensors.max_range_m, cellWord);
    free.push(...sector(state, sensors, towards, 0, range_m));
    if (!isEcho) continue;
    hits.push(...sector(state, sensors, towards, Math.max(0, range_m - 0.06), range_m + 0.02));
    const at = [state.x + range_m * Math.cos(towards), state.y + range_m * Math.sin(towards), state.z + sensors.height_m + 0.25];
    echoes.push({ text: `${range_m.toFixed(1)} m`, at, range_m });
  }
  nearest(echoes);
  return [fill(free, 0x0b8fd9, 0.13), fill(hits, 0xd9480f, 0.95)];
}

/** How far the map is not occupied along an axis, and whether it is then. */
function rangeOf(state, towards, most_m, cellWord) {
  const [x, y] = [Math.cos(towards), Math.sin(towards)];
  for (let away = 0.2; away < most_m; away += STEP_M) {
    if (cellWord(state.x + away * x, state.y + away * y) === "occupied") return [away, true];
  }
  return [most_m, false];
}

/** The triangles of a part of a sector, at the sensor's height. */
function sector(state, { half_angle_rad, height_m }, towards, near, far) {
  const at = (angle, away) => [state.x + away * Math.cos(angle), state.y + away * Math.sin(angle), state.z + height_m];
  const corners = [];
  for (let i = 0; i < ARC_PARTS; i++) {
    const [one, other] = [i, i + 1].map((part) => towards + half_angle_rad * ((2 * part) / ARC_PARTS - 1));
    corners.push(...at(one, near), ...at(one, far), ...at(other, far), ...at(one, near), ...at(other, far), ...at(other, near));
  }
  return corners;
}

function shape(corners) {
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(corners, 3));
}

function fill(corners, color, opacity) {
  const material = new MeshBasicMaterial({ color, transparent: true, opacity, side: DoubleSide, depthWrite: false });
  return new Mesh(shape(corners), material);
}
