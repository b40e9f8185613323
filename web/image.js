// The image of the radio links: mean, deviation, significance. The scale is fixed until somebody chooses another one, since noise
// on a scale of its own looks like something found; the mean of what is uncertain is paler.

import { drawFindsOver, drawHistory, findText, numbered } from "./finds.js";

const SIGNIFICANCE_MOST = 6;
const BELOW_ZERO = [0, 160, 150];
/** What a pixel keeps of its colour when nothing is known of it. */
const PALEST = 0.25;

export class ImagePanel {
  constructor(model) {
    this.model = model;
    this.wanted = () => {};
    this.isChosen = false;
    for (const id of ["image-subject", "image-plane", "image-scale", "finds-measure"]) document.getElementById(id).addEventListener("change", () => this.wanted());
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
    drawFindsOver(document.getElementById("heat-finds"), canvas, image, found);
    text.textContent = `${caption(image, plane, scaleOf())} Run ${image.run}, lap ${image.laps}, ${image.linksUsed} links, ${image.linksDropped} left out.`;
  }

  showFinds(subject) {
    const known = this.model.finds.get(subject) ?? {};
    const earlier = known.earlier ?? [];
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
export function imageCanvas(model, image, plane, isOverMap) {
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

function valueOf(image, plane, index) {
  if (plane === "mean") return image.mean[index];
  if (plane === "deviation") return image.deviation[index];
  return image.mean[index] / image.deviation[index];
}

/** The colour of a share of the scale; `sure` = how much of it stays. */
function pixelColour(model, share, sure, isOverMap) {
  if (Number.isNaN(share)) return [0, 0, 0, 0];
  const colours = model.place.heat;
  const level = Math.round(Math.min(1, Math.max(0, share)) * (colours.length - 1));
  const below = Math.min(1, -share);
  const colour = share < 0 ? BELOW_ZERO.map((channel, i) => Math.round(colours[0][i] + (channel - colours[0][i]) * below)) : colours[level];
  const alpha = isOverMap ? Math.min(0.85, Math.abs(share) * 1.6) * sure : sure;
  return [...colour, Math.round(255 * alpha)];
}
