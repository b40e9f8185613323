// Words in the three-dimensional scene: of one size on the screen wherever they are, with a rim, so that they read on anything. A
// word that is put again is not made again.

import { CanvasTexture, SRGBColorSpace, Sprite, SpriteMaterial } from "./vendor/three.js";

/** Canvas pixels for each pixel of the screen. */
const FINE = 2;
const TANGENT = 2 * Math.tan((55 * Math.PI) / 360);

export class Labels {
  constructor(scene) {
    this.scene = scene;
    this.made = new Map();
  }

  forget() {
    for (const { sprite } of this.made.values()) {
      this.scene.remove(sprite);
      sprite.material.map.dispose();
      sprite.material.dispose();
    }
    this.made.clear();
  }

  /** A frame begins: words of other colours are made anew. */
  begin(ink, paper, height) {
    if (this.ink !== ink || this.paper !== paper) this.forget();
    this.ink = ink;
    this.paper = paper;
    this.height = height;
    this.count = new Map();
    for (const label of this.made.values()) label.isPut = false;
  }

  put(text, x, y, z, size) {
    const of = `${size} ${text}`;
    const nth = this.count.get(of) ?? 0;
    this.count.set(of, nth + 1);
    const key = `${of} ${nth}`;
    const label = this.made.get(key) ?? this.make(key, text, size);
    label.isPut = true;
    const scale = (TANGENT * FINE ** -1) / this.height;
    label.sprite.scale.set(label.width * scale, label.height * scale, 1);
    label.sprite.position.set(x, y, z);
  }

  /** A frame ends: what was not put again goes. */
  end() {
    for (const [key, { isPut, sprite }] of this.made) {
      if (isPut) continue;
      this.scene.remove(sprite);
      sprite.material.map.dispose();
      sprite.material.dispose();
      this.made.delete(key);
    }
  }

  make(key, text, size) {
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    const font = `bold ${size * FINE}px system-ui, sans-serif`;
    pen.font = font;
    canvas.width = Math.ceil(pen.measureText(text).width) + 6 * FINE;
    canvas.height = Math.ceil(size * 1.5 * FINE);
    pen.font = font;
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = 3 * FINE;
    pen.strokeStyle = this.paper;
    pen.strokeText(text, 3 * FINE, canvas.height / 2);
    pen.fillStyle = this.ink;
    pen.fillText(text, 3 * FINE, canvas.height / 2);
    const map = new CanvasTexture(canvas);
    map.colorSpace = SRGBColorSpace;
    const sprite = new Sprite(new SpriteMaterial({ map, sizeAttenuation: false, depthTest: false, transparent: true }));
    sprite.renderOrder = 100;
    this.scene.add(sprite);
    const label = { sprite, width: canvas.width, height: canvas.height, isPut: true };
    this.made.set(key, label);
    return label;
  }
}
