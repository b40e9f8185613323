// The image of the radio links: mean, deviation, significance, with a scale that grows and never shrinks by itself, so that
// noise does not look like something found.

import { drawFindsOver, drawHistory, findText, numbered } from "./finds.js";

const STEPS_DBPM = [0.25, 0.5, 1, 2, 4, 8, 16, 32];
const SIGNIFICANCE_MOST = 6;
const BELOW_ZERO = [0, 160, 150];
const scales = new Map();

export class ImagePanel {
  constructor(model) {
    this.model = model;
    this.wanted = () => {};
    this.isChosen = false;
    for (const id of ["image-subject", "image-plane", "finds-measure"]) document.getElementById(id).addEventListener("change", () => this.wanted());
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
    text.textContent = `${caption(image, plane)} Run ${image.run}, lap ${image.laps}, ${image.linksUsed} links, ${image.linksDropped} left out.`;
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

function caption(image, plane) {
  const isKnown = !Number.isNaN(image.deviation[0]);
  if (plane !== "mean" && !isKnown) return "The deviation of this image is not known.";
  switch (plane) {
    case "mean": return `0 (dark) to ${scaleOf(image)} dB/m (bright); below zero teal.`;
    case "deviation": return `Deviation, 0 (dark) to ${scaleOf(image)} dB/m (bright).`;
    default: return `Mean over deviation, 0 (dark) to ${SIGNIFICANCE_MOST} (bright).`;
  }
}

/** The end of an image's scale, dB/m. */
export function scaleOf(image) {
  let most = 0;
  for (const value of image.mean) if (value > most) most = value;
  const fits = STEPS_DBPM.find((step) => step >= most) ?? STEPS_DBPM.at(-1);
  const scale = Math.max(fits, scales.get(image.subject) ?? 0);
  scales.set(image.subject, scale);
  return scale;
}

/** A canvas with a pixel for each of the image, north up; over a map, what is near zero lets it through. */
export function imageCanvas(model, image, plane, isOverMap) {
  const of = `${image.version} ${plane} ${isOverMap}`;
  image.pictures ??= new Map();
  const known = image.pictures.get(`${plane} ${isOverMap}`);
  if (known?.of === of) return known.canvas;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.columns, image.rows];
  const pen = canvas.getContext("2d");
  const pixels = pen.createImageData(image.columns, image.rows);
  const scale = plane === "significance" ? SIGNIFICANCE_MOST : scaleOf(image);
  for (let row = 0; row < image.rows; row++) {
    for (let column = 0; column < image.columns; column++) {
      const index = row * image.columns + column;
      const at = ((image.rows - 1 - row) * image.columns + column) * 4;
      pixels.data.set(pixelColour(model, valueOf(image, plane, index) / scale, image.deviation[index] / scale, isOverMap), at);
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

/** The colour of a share of the scale; what is uncertain fades. */
function pixelColour(model, share, deviation, isOverMap) {
  if (Number.isNaN(share)) return [0, 0, 0, 0];
  const colours = model.place.heat;
  const level = Math.round(Math.min(1, Math.max(0, share)) * (colours.length - 1));
  const below = Math.min(1, -share);
  const colour = share < 0 ? BELOW_ZERO.map((channel, i) => Math.round(colours[0][i] + (channel - colours[0][i]) * below)) : colours[level];
  const sure = Number.isNaN(deviation) ? 1 : Math.max(0.25, 1 - deviation);
  const alpha = isOverMap ? Math.min(0.85, Math.abs(share) * 1.6) * sure : sure;
  return [...colour, Math.round(255 * alpha)];
}
