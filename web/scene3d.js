// The scene in three dimensions: the camera that flies, orbits or rides with a vehicle, and drawing on demand. What is drawn is in
// layers3d.js. x east, y north, z up, metres.

/** @import { Model } from "./model.js" */

import { Layers } from "./layers3d.js";
import { AmbientLight, Color, DirectionalLight, OrbitControls, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "./vendor/three.js";

const FIELD_DEG = 55;
const RIDE_FIELD_DEG = 75;
const RATIO_MOST = 1.5;
/** Metres a second of a flight, for each metre of height. */
const SPEED_PER_M = 0.9;
const TURN_RADPS = 1.2;
/** A ride is seen from this much above and behind the vehicle's place. */
const RIDE = { up_m: 0.45, back_m: 0.25, down_rad: 0.14 };
/** Keys that move, and where to: forwards, to the right, up. */
const MOVES = {
  w: [1, 0, 0], arrowup: [1, 0, 0], s: [-1, 0, 0], arrowdown: [-1, 0, 0],
  a: [0, -1, 0], arrowleft: [0, -1, 0], d: [0, 1, 0], arrowright: [0, 1, 0], e: [0, 0, 1], q: [0, 0, -1],
};

export class Space {
  constructor(/** @type {Model} */ model, plane, token) {
    this.model = model;
    this.plane = plane;
    this.canvas = document.getElementById("space");
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: false, preserveDrawingBuffer: true });
    this.scene = new Scene();
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(-0.5, -0.8, 1.4);
    this.scene.add(new AmbientLight(0xffffff, 1.7), sun);
    this.camera = new PerspectiveCamera(FIELD_DEG, 1, 0.05, 2000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.maxPolarAngle = Math.PI / 2 - 0.02;
    this.controls.addEventListener("change", () => { this.moved(); this.wanted(); });
    this.layers = new Layers(model, plane, this.scene, token, () => this.wanted());
    this.riding = null;
    this.mode = "space";
    this.look = 0;
    this.frames = 0;
    this.pressed = new Set();
    this.wanted = () => {};
    this.hovered = (_at) => {};
    this.moved = () => {};
    this.isFitted = false;
    this.listen();
    new ResizeObserver(() => this.wanted()).observe(this.canvas);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("keyup", (event) => this.pressed.delete(event.key.toLowerCase()));
    canvas.addEventListener("blur", () => this.pressed.clear());
    const pointed = (event) => {
      const box = canvas.getBoundingClientRect();
      this.hovered(this.groundAt(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2));
    };
    canvas.addEventListener("pointerdown", pointed);
    canvas.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse") this.hovered(null); });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) pointed(event);
      if (this.mode !== "ride" || event.buttons === 0) return;
      this.look -= event.movementX / 300;
      this.wanted();
    });
    document.getElementById("zoom-fit").addEventListener("click", () => this.reset());
    document.getElementById("zoom-in").addEventListener("click", () => this.dolly(0.8));
    document.getElementById("zoom-out").addEventListener("click", () => this.dolly(1.25));
    canvas.addEventListener("webglcontextrestored", () => { this.layers.forget(); this.wanted(); });
  }

  key(event) {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (key === "r" || key === "0") this.reset();
    else if (key === "+") this.dolly(0.8);
    else if (key === "-") this.dolly(1.25);
    else if (MOVES[key]) this.press(key);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** As long as a key is down the camera moves, and frame follows frame. */
  press(key) {
    const isFirst = this.pressed.size === 0;
    this.pressed.add(key);
    if (!isFirst) return;
    let before_ms = performance.now();
    const step = (at_ms) => {
      if (this.pressed.size === 0) return;
      this.fly(Math.min(0.1, Math.max(0, at_ms - before_ms) / 1000));
      before_ms = at_ms;
      this.wanted();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  fly(elapsed_s) {
    const sum = [0, 0, 0];
    for (const key of this.pressed) MOVES[key].forEach((part, axis) => { sum[axis] += part; });
    if (this.mode === "ride") {
      this.look -= sum[1] * TURN_RADPS * elapsed_s;
      return;
    }
    const ahead = this.camera.getWorldDirection(new Vector3()).setZ(0).normalize();
    const right = new Vector3(ahead.y, -ahead.x, 0);
    const way = ahead.multiplyScalar(sum[0]).addScaledVector(right, sum[1]).add(new Vector3(0, 0, sum[2]));
    way.multiplyScalar(SPEED_PER_M * Math.max(1, this.camera.position.z) * elapsed_s);
    if (this.camera.position.z + way.z < 0.15) way.z = 0;
    this.camera.position.add(way);
    this.controls.target.add(way);
    this.controls.update();
  }

  dolly(factor) {
    if (this.mode === "ride") return;
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.wanted();
  }

  /** The place of the ground at a point of the picture, -1 to 1 to the right and up; null = the sky is there. */
  groundAt(right, up) {
    const { position } = this.camera;
    const ray = new Vector3(right, up, 0.5).unproject(this.camera).sub(position);
    if (ray.z > -1e-6) return null;
    const share = -position.z / ray.z;
    return [position.x + share * ray.x, position.y + share * ray.y];
  }

  /** Everything that the place names is seen, from the south. */
  reset() {
    this.look = 0;
    this.isFitted = false;
    this.wanted();
  }

  fit() {
    const { fence, area, homes } = this.model.place;
    const [xs, ys] = [0, 1].map((axis) => [...fence, ...area, ...homes].map((at) => at[axis]));
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    const tangent = Math.tan((FIELD_DEG * Math.PI) / 360);
    const away = Math.max((right - left) / aspect, (high - low) * 0.85) / 2 / tangent * 1.3;
    const [x, y] = [(left + right) / 2, (low + high) / 2];
    this.controls.target.set(x, y, 0);
    this.camera.position.set(x, y - away * 0.72, away * 0.8);
    this.controls.update();
    this.isFitted = true;
  }

  enter(mode) {
    if (mode === "plane") return;
    if (mode !== this.mode) this.look = 0;
    if (this.mode === "ride" && mode === "space") this.isFitted = false;
    this.mode = mode;
    this.controls.enabled = mode === "space";
    this.camera.fov = mode === "ride" ? RIDE_FIELD_DEG : FIELD_DEG;
  }

  /** The camera where the vehicle is, looking where it looks. */
  ride() {
    const state = this.model.states.get(this.riding);
    if (!state?.isPlaced) return;
    const towards = state.heading + this.look;
    const [x, y] = [Math.cos(towards), Math.sin(towards)];
    const eye = new Vector3(state.x - x * RIDE.back_m, state.y - y * RIDE.back_m, state.z + RIDE.up_m);
    this.camera.position.copy(eye);
    this.camera.lookAt(eye.x + x, eye.y + y, eye.z - Math.tan(RIDE.down_rad));
  }

  draw(now_ms) {
    const { canvas, model } = this;
    if (!model.place || canvas.clientWidth === 0) return;
    const ratio = Math.min(devicePixelRatio || 1, RATIO_MOST);
    this.renderer.setPixelRatio(ratio);
    const size = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.floor(size[0] * ratio) || canvas.height !== Math.floor(size[1] * ratio)) this.renderer.setSize(...size, false);
    this.camera.aspect = size[0] / size[1];
    this.camera.updateProjectionMatrix();
    if (!this.isFitted) this.fit();
    if (this.mode === "ride") this.ride();
    this.scene.background = new Color(getComputedStyle(canvas).getPropertyValue("--sky").trim() || "#dfe6ee");
    this.layers.update(now_ms, { riding: this.mode === "ride" ? this.riding : null, height: size[1], camera: this.camera });
    this.renderer.render(this.scene, this.camera);
    this.frames += 1;
  }
}
