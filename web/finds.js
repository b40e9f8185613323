// What was found in the images of a run: each find's ellipse of one standard deviation over the picture, how it shrinks, and its
// deviation, strength or probability against time. Finds of one place in several images are one, with a number and a shape.

/** @import { ImageFinds } from "./told" */

import { ellipsePlaces } from "./draw.js";

/** Finds of two images that are nearer than this are one. */
const SAME_FIND_M = 1;
/** What can be drawn against time: its name, its unit, and the least that the axis reaches to. */
export const MEASURES = {
  deviation: { unit: "± m", least: 0.5, digits: 2, of: (find) => find.ellipse?.major_m ?? find.sd_m },
  strength: { unit: "dB/m", least: 0.5, digits: 2, of: (find) => find.strength_dbpm },
  probability: { unit: "%", least: 100, digits: 0, of: (find) => (find.probability === null ? null : find.probability * 100) },
};
const HEIGHT = 150;
const BORDER = { left: 44, right: 26, top: 10, bottom: 30 };
/** Two words of an axis are this far apart, pixels. */
const APART = 42;

/** The images of the newest one's run, oldest first, each find with the number of its place. */
export function numbered(/** @type {Pick<ImageFinds, "finds" | "earlier" | "run" | "laps" | "at_s">} */ { finds, earlier, run, laps, at_s }) {
  const images = [...earlier, { finds, run, laps, at_s }].filter((image) => image.run === run);
  const places = [];
  return images.map((image) => {
    const free = new Set(places.keys());
    const known = image.finds.map((find) => {
      const away = (place) => Math.hypot(places[place][0] - find.at[0], places[place][1] - find.at[1]);
      const [near] = [...free].filter((place) => away(place) < SAME_FIND_M).sort((one, other) => away(one) - away(other));
      const place = near ?? places.length;
      free.delete(place);
      places[place] = find.at;
      return { ...find, number: place + 1 };
    });
    return { ...image, finds: known };
  });
}

/** Draws a measure of all finds against time; hidden while there is no line to draw. */
export function drawHistory(canvas, images, name) {
  const measure = MEASURES[name];
  const points = images.flatMap(({ finds, at_s }) => finds.map((find) => ({ number: find.number, at_s, value: measure.of(find), find }))).filter(({ value }) => value !== null);
  canvas.hidden = images.length < 2 || points.length === 0;
  if (canvas.hidden) return;
  const ratio = Math.min(devicePixelRatio || 1, 1.5);
  const width = canvas.clientWidth || 300;
  [canvas.width, canvas.height] = [width * ratio, HEIGHT * ratio];
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.font = "11px system-ui, sans-serif";
  const style = getComputedStyle(canvas);
  const [ink, faint] = ["--ink", "--faint"].map((of) => style.getPropertyValue(of));
  const most = Math.max(measure.least, ...points.map(({ value }) => value));
  const [from_s, to_s] = [images[0].at_s, images.at(-1).at_s];
  const x = (at_s) => BORDER.left + ((at_s - from_s) / Math.max(1e-3, to_s - from_s)) * (width - BORDER.left - BORDER.right);
  const y = (value) => HEIGHT - BORDER.bottom - (Math.max(0, value) / most) * (HEIGHT - BORDER.top - BORDER.bottom);
  pen.fillStyle = faint;
  pen.fillRect(BORDER.left - 4, y(0), width - BORDER.left, 1);
  pen.fillText(most.toFixed(measure.digits === 0 ? 0 : 1), 2, y(most) + 4);
  pen.fillText(measure.unit, 2, (y(most) + y(0)) / 2);
  pen.fillText("0", 2, y(0) + 4);
  drawLaps(pen, images, x);
  pen.strokeStyle = pen.fillStyle = ink;
  for (const number of new Set(points.map((point) => point.number))) drawLine(pen, points.filter((point) => point.number === number), { x, y, isDeviation: name === "deviation" });
}

function drawLaps(pen, images, x) {
  let last = -Infinity;
  let before = null;
  for (const { laps, at_s } of images) {
    if (laps === before) continue;
    before = laps;
    pen.fillRect(x(at_s), HEIGHT - BORDER.bottom, 1, 5);
    if (x(at_s) - last < APART) continue;
    last = x(at_s);
    pen.fillText(`lap ${laps}`, x(at_s) - 8, HEIGHT - BORDER.bottom + 16);
  }
}

function drawLine(pen, points, { x, y, isDeviation }) {
  pen.lineWidth = 1;
  pen.setLineDash(DASHES[(points[0].number - 1) % DASHES.length]);
  pen.beginPath();
  for (const { at_s, value } of points) pen.lineTo(x(at_s), y(value));
  pen.stroke();
  pen.setLineDash([]);
  for (const { at_s, value, number, find } of points) {
    // From the shorter half of the ellipse's axes to the longer one.
    if (isDeviation && find.ellipse) pen.fillRect(x(at_s) - 0.5, y(value), 1, y(find.ellipse.minor_m) - y(value));
    shape(pen, number, x(at_s), y(value));
  }
  const last = points.at(-1);
  pen.fillText(String(last.number), x(last.at_s) + 8, y(last.value) + 4);
}

const DASHES = [[], [5, 3], [2, 3], [8, 3, 2, 3]];

/** The mark of a find's number: square, disc, triangle, diamond. */
function shape(pen, number, x, y) {
  const corners = [4, 20, 3, 4][(number - 1) % 4];
  const turned = [Math.PI / 4, 0, Math.PI / 2, 0][(number - 1) % 4];
  pen.beginPath();
  for (let corner = 0; corner < corners; corner++) {
    const angle = turned + (corner * 2 * Math.PI) / corners;
    pen.lineTo(x + 4 * Math.cos(angle), y - 4 * Math.sin(angle));
  }
  pen.fill();
}

/** Tells where a place, metres, lies on a canvas that shows the area of an image, north up, pixels. */
export function placesOn(canvas, image) {
  const share = (mm, least, greatest) => (mm - least) / (greatest - least);
  return ([x, y]) => [
    share(x * 1000, image.least_x_mm, image.greatest_x_mm) * canvas.width,
    canvas.height - share(y * 1000, image.least_y_mm, image.greatest_y_mm) * canvas.height,
  ];
}

/** Draws the finds of the newest image over a picture of its area, those of the images before faintly. */
export function drawFindsOver(canvas, image, images) {
  const pen = canvas.getContext("2d");
  const pixel = placesOn(canvas, image);
  images.forEach(({ finds }, index) => {
    const isNewest = index === images.length - 1;
    for (const find of finds) drawFind(pen, find, pixel, isNewest);
  });
}

function drawFind(pen, find, pixel, isNewest) {
  pen.globalAlpha = isNewest ? 1 : 0.3;
  for (const [colour, width] of isNewest ? [["#000000", 4], ["#ffffff", 1.5]] : [["#ffffff", 1]]) {
    [pen.strokeStyle, pen.lineWidth] = [colour, width];
    pen.beginPath();
    for (const place of ellipsePlaces(find)) pen.lineTo(...pixel(place));
    pen.stroke();
  }
  if (!isNewest) return;
  const [x, y] = pixel(find.at);
  pen.font = "bold 13px system-ui, sans-serif";
  [pen.strokeStyle, pen.lineWidth, pen.fillStyle] = ["#000000", 3, "#ffffff"];
  pen.strokeText(String(find.number), x + 6, y - 6);
  pen.fillText(String(find.number), x + 6, y - 6);
}

/** A find in words. */
export function findText(find) {
  const sd = find.sd_m === null ? "deviation unknown" : `± ${find.sd_m.toFixed(2)} m`;
  const { major_m, minor_m, angle_rad } = find.ellipse ?? {};
  const ellipse = find.ellipse ? `; ellipse ${major_m.toFixed(2)} × ${minor_m.toFixed(2)} m, the longer ${((angle_rad * 180) / Math.PI).toFixed(0)}° from x` : "";
  const probable = find.probability === null ? "" : `, ${(find.probability * 100).toFixed(0)} % probable`;
  return `x ${find.at[0].toFixed(2)}, y ${find.at[1].toFixed(2)} m (${sd}${ellipse}), ${find.strength_dbpm.toFixed(2)} dB/m${probable}`;
}
