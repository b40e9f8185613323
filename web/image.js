// The image of the radio links: mean, deviation, significance, with a scale that grows and never shrinks by itself, so that
// noise does not look like something found.

const STEPS_DBPM = [0.25, 0.5, 1, 2, 4, 8, 16, 32];
const SIGNIFICANCE_MOST = 6;
/** Finds of two images that are nearer than this are one. */
const SAME_FIND_M = 1;
const BELOW_ZERO = [0, 160, 150];
const scales = new Map();

export class ImagePanel {
  constructor(model) {
    this.model = model;
    this.wanted = () => {};
    this.isChosen = false;
    for (const id of ["image-subject", "image-plane"]) document.getElementById(id).addEventListener("change", () => this.wanted());
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
    this.showFinds(subject);
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
    text.textContent = `${caption(image, plane)} Run ${image.run}, lap ${image.laps}, ${image.linksUsed} links, ${image.linksDropped} left out.`;
  }

  showFinds(subject) {
    const { finds = [], earlier = [] } = this.model.finds.get(subject) ?? {};
    document.getElementById("finds").replaceChildren(...finds.map((find) => item(`find at ${findText(find)}`)));
    document.getElementById("earlier").hidden = earlier.length === 0;
    const lines = earlier.map((image) => {
      const found = image.finds.map(findText).join("; ") || "nothing";
      return item(`${this.model.timeText(image.at_s * 1000)} run ${image.run}, lap ${image.laps}: ${found}`);
    });
    document.getElementById("earlier-finds").replaceChildren(...lines.reverse());
    const image = this.model.images.get(subject);
    const newest = { at_s: this.model.shown_ms / 1000, run: image?.run, finds };
    const images = [...earlier, newest].filter((of) => of.run === image?.run);
    drawHistory(document.getElementById("finds-history"), images);
  }
}

/** How sure each find was in the images of this run: it sharpens, or it does not. Those of one place are joined. */
function drawHistory(canvas, images) {
  const points = images.flatMap(({ finds }, index) => finds.map((find) => ({ ...find, index }))).filter(({ sd_m }) => sd_m !== null);
  canvas.hidden = images.length < 2 || points.length === 0;
  if (canvas.hidden) return;
  const ratio = Math.min(devicePixelRatio || 1, 1.5);
  const [width, height] = [canvas.clientWidth || 300, 110];
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  const [ink, faint] = ["--ink", "--faint"].map((name) => style.getPropertyValue(name));
  const most_m = Math.max(0.5, ...points.map(({ sd_m }) => sd_m));
  const x = (index) => 44 + (index * (width - 60)) / Math.max(1, images.length - 1);
  const y = (sd_m) => height - 18 - (sd_m / most_m) * (height - 34);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = faint;
  pen.fillRect(40, y(0), width - 44, 1);
  pen.fillText(`± ${most_m.toFixed(1)} m`, 0, y(most_m) + 4);
  pen.fillText("± 0", 0, y(0) + 4);
  pen.fillText(`deviation of finds, ${images.length} images of the run`, 44, height - 3);
  pen.strokeStyle = pen.fillStyle = ink;
  for (const point of points) {
    const before = points.filter((other) => other.index === point.index - 1 && Math.hypot(other.at[0] - point.at[0], other.at[1] - point.at[1]) < SAME_FIND_M);
    for (const other of before.slice(0, 1)) {
      pen.beginPath();
      pen.moveTo(x(other.index), y(other.sd_m));
      pen.lineTo(x(point.index), y(point.sd_m));
      pen.stroke();
    }
    pen.fillRect(x(point.index) - 3, y(point.sd_m) - 3, 6, 6);
  }
}

function item(text) {
  const made = document.createElement("li");
  made.textContent = text;
  return made;
}

function findText(find) {
  const sd = find.sd_m === null ? "deviation unknown" : `± ${find.sd_m.toFixed(2)} m`;
  return `x ${find.at[0].toFixed(2)}, y ${find.at[1].toFixed(2)} m (${sd}), ${find.strength_dbpm.toFixed(2)} dB/m`;
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
