// The image of the radio links: mean, deviation, significance. The scale is fixed until somebody chooses another one, since noise
// on a scale of its own looks like something found; the mean of what is uncertain is paler, and hatched where the links have told
// nothing. What truly stands in a simulation can be drawn over it.

/** @import { Model } from "./model.js" */

import { TRUTH } from "./draw.js";
import { drawFindsOver, drawHistory, findText, numbered, placesOn } from "./finds.js";

const SIGNIFICANCE_MOST = 6;
const BELOW_ZERO = [0, 160, 150];
/** What a pixel keeps of its colour when nothing is known of it. */
const PALEST = 0.25;
/** A deviation of so much of the prior's is as large: what comes over the feed is rounded. */
const AS_BEFORE = 0.98;
/** What was found where nothing was said of any image. */
const NOTHING = { finds: [], earlier: [], run: 0, laps: 0, at_s: 0 };
/** Lines of a hatch are so far apart at least, pixels. */
const HATCH_APART = 6;

export class ImagePanel {
  constructor(/** @type {Model} */ model) {
    this.model = model;
    this.wanted = () => {};
    this.isChosen = false;
    for (const id of ["image-subject", "image-plane", "image-scale", "finds-measure", "layer-truth"]) document.getElementById(id).addEventListener("change", () => this.wanted());
    document.getElementById("image-subject").addEventListener("change", () => { this.isChosen = true; });
  }

  draw() {
    const choice = document.getElementById("image-subject");
    // Until somebody chooses, the change is shown, or what there is.
    const { images } = this.model;
    if (!this.isChosen) choice.value = images.has(0) && !images.has(1) ? "0" : "1";
    const subject = Number(choice.value);
    const plane = document.getElementById("image-plane").value;
    const image = this.model.images.get(subject);
    const canvas = document.getElementById("heat");
    const text = document.getElementById("heat-scale");
    const found = this.showFinds(subject);
    document.getElementById("heat-finds").hidden = !image;
    if (!image) {
      text.textContent = "No image yet: the ground station makes one when there are links.";
      canvas.hidden = true;
      return;
    }
    canvas.hidden = false;
    const picture = imageCanvas(this.model, image, plane, false);
    const side = Math.max(1, Math.floor(320 / Math.max(image.columns, image.rows)));
    [canvas.width, canvas.height] = [image.columns * side, image.rows * side];
    const pen = canvas.getContext("2d");
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
    const over = document.getElementById("heat-finds");
    [over.width, over.height] = [canvas.width, canvas.height];
    const prior_dbpm = plane === "mean" ? this.model.finds.get(subject)?.priorSd_dbpm ?? Infinity : Infinity;
    const isHatched = drawHatch(over, image, prior_dbpm);
    const { truth } = this.model.place;
    if (truth && document.getElementById("layer-truth").checked) drawTruthOver(over, image, truth);
    drawFindsOver(over, image, found);
    const hatched = isHatched ? ` Hatched: the deviation is that of the prior, ${prior_dbpm.toFixed(2)} dB/m, or more.` : "";
    text.textContent = `${caption(image, plane, scaleOf())}${hatched} Run ${image.run}, lap ${image.laps}, ${image.linksUsed} links, ${image.linksDropped} left out.`;
  }

  showFinds(subject) {
    const known = this.model.finds.get(subject) ?? NOTHING;
    const { earlier } = known;
    const images = numbered(known);
    const measure = document.getElementById("finds-measure");
    document.getElementById("finds").replaceChildren(...images.at(-1).finds.map((find) => item(`find ${find.number} at ${findText(find)}`)));
    document.getElementById("earlier").hidden = earlier.length === 0;
    const lines = earlier.map((image) => {
      const found = image.finds.map(findText).join("; ") || "nothing";
      return item(`${this.model.timeText(image.at_s * 1000)} run ${image.run}, lap ${image.laps}: ${found}`);
    });
    document.getElementById("earlier-finds").replaceChildren(...lines.reverse());
    const history = document.getElementById("finds-history");
    // Whoever has chosen what is not known of any sees that there is nothing, and can choose again.
    document.getElementById("finds-measure-choice").hidden = images.length < 2 || images.every(({ finds }) => finds.length === 0);
    drawHistory(history, images, measure.value);
    return images;
  }
}

function item(text) {
  const made = document.createElement("li");
  made.textContent = text;
  return made;
}

function caption(image, plane, scale) {
  const isKnown = !Number.isNaN(image.deviation[0]);
  if (plane !== "mean" && !isKnown) return "The deviation of this image is not known.";
  const most = greatest(image[plane] ?? []);
  const beyond = most > scale ? `; the greatest is ${most.toFixed(1)}` : "";
  switch (plane) {
    case "mean": return `0 (dark) to ${scale} dB/m (bright)${beyond}; below zero teal${isKnown ? "; the less certain the paler" : ""}.`;
    case "deviation": return `Deviation, 0 (dark) to ${scale} dB/m (bright)${beyond}.`;
    default: return `Mean over deviation, 0 (dark) to ${SIGNIFICANCE_MOST} (bright).`;
  }
}

/** The end of the scale of images in the view of them, dB/m. */
function scaleOf() {
  return Number(document.getElementById("image-scale").value);
}

/** The greatest number of many; 0 when there is none above. */
function greatest(values) {
  let most = 0;
  for (const value of values) if (value > most) most = value;
  return most;
}

/** A canvas with a pixel for each of the image, north up; over a map, what is near zero lets it through. */
export function imageCanvas(/** @type {Model} */ model, image, plane, isOverMap) {
  const scale = plane === "significance" ? SIGNIFICANCE_MOST : scaleOf();
  const of = `${image.version} ${plane} ${isOverMap} ${scale}`;
  image.pictures ??= new Map();
  const known = image.pictures.get(`${plane} ${isOverMap}`);
  if (known?.of === of) return known.canvas;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.columns, image.rows];
  const pen = canvas.getContext("2d");
  const pixels = pen.createImageData(image.columns, image.rows);
  // What no link has crossed is as uncertain as before all measuring, and more than anything else.
  const unsure = plane === "mean" ? greatest(image.deviation) : 0;
  for (let row = 0; row < image.rows; row++) {
    for (let column = 0; column < image.columns; column++) {
      const index = row * image.columns + column;
      const at = ((image.rows - 1 - row) * image.columns + column) * 4;
      const sure = unsure > 0 ? 1 - (1 - PALEST) * (image.deviation[index] / unsure) : 1;
      pixels.data.set(pixelColour(model, valueOf(image, plane, index) / scale, Number.isNaN(sure) ? 1 : sure, isOverMap), at);
    }
  }
  pen.putImageData(pixels, 0, 0);
  image.pictures.set(`${plane} ${isOverMap}`, { of, canvas });
  return canvas;
}

/** Hatches the pixels of which the links have told nothing: they are as uncertain as before all measuring. Returns whether there are any. */
function drawHatch(over, image, prior_dbpm) {
  const pen = over.getContext("2d");
  const { width, height } = over;
  const side = width / image.columns;
  let isAny = false;
  pen.save();
  pen.beginPath();
  image.deviation.forEach((deviation, index) => {
    // What is not known is no number.
    if (!(deviation >= AS_BEFORE * prior_dbpm)) return;
    isAny = true;
    pen.rect((index % image.columns) * side, (image.rows - 1 - Math.floor(index / image.columns)) * side, side, side);
  });
  pen.clip();
  const apart = Math.max(side, HATCH_APART);
  for (const { colour, thick } of isAny ? [{ colour: "#000000", thick: 2 }, { colour: "#ffffff", thick: 0.75 }] : []) {
    [pen.strokeStyle, pen.lineWidth] = [colour, thick];
    pen.beginPath();
    for (let at = -height; at < width; at += apart) {
      pen.moveTo(at, height);
      pen.lineTo(at + height, 0);
    }
    pen.stroke();
  }
  pen.restore();
  return isAny;
}

/** Draws what truly stands in the scene of a simulation over the picture: outlines, and persons with their names. */
function drawTruthOver(over, image, { outlines, persons }) {
  const pen = over.getContext("2d");
  const pixel = placesOn(over, image);
  [pen.strokeStyle, pen.fillStyle, pen.lineWidth, pen.font] = [TRUTH, TRUTH, 2, "bold 12px system-ui, sans-serif"];
  const path = (places) => {
    pen.beginPath();
    for (const place of places) pen.lineTo(...pixel(place));
    pen.closePath();
    pen.stroke();
  };
  outlines.forEach(path);
  pen.setLineDash([4, 3]);
  for (const { name, at: [x, y], radius_m } of persons) {
    path(Array.from({ length: 24 }, (_, i) => [x + radius_m * Math.cos((i * Math.PI) / 12), y + radius_m * Math.sin((i * Math.PI) / 12)]));
    const [right, middle] = pixel([x + radius_m, y]);
    pen.fillText(name, right + 3, middle + 4);
  }
  pen.setLineDash([]);
}

function valueOf(image, plane, index) {
  if (plane === "mean") return image.mean[index];
  if (plane === "deviation") return image.deviation[index];
  return image.mean[index] / image.deviation[index];
}

/** The colour of a share of the scale; `sure` = how much of it stays. */
function pixelColour(/** @type {Model} */ model, share, sure, isOverMap) {
  if (Number.isNaN(share)) return [0, 0, 0, 0];
  const colours = model.place.heat;
  const level = Math.round(Math.min(1, Math.max(0, share)) * (colours.length - 1));
  const below = Math.min(1, -share);
  const colour = share < 0 ? BELOW_ZERO.map((channel, i) => Math.round(colours[0][i] + (channel - colours[0][i]) * below)) : colours[level];
  const alpha = isOverMap ? Math.min(0.85, Math.abs(share) * 1.6) * sure : sure;
  return [...colour, Math.round(255 * alpha)];
}
