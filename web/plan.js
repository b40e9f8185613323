// The plans against time: a row for each vehicle, a box for each stop, an arrow for each wait, where the swarm is now, and the
// chain of stops that takes longest. Times are those of one steady speed, which the server says.

/** @import { Model } from "./model.js" */

const ROW = 30;
const TOP = 22;
const LEFT = 44;
const STOP_PIXELS = 14;

export class PlanPanel {
  constructor(/** @type {Model} */ model) {
    this.model = model;
    this.canvas = document.getElementById("gantt");
    this.wanted = () => {};
  }

  draw() {
    const table = this.model.timetable;
    const rows = table?.rows ?? [];
    this.canvas.hidden = rows.length === 0;
    this.tell(table, rows);
    if (rows.length === 0) return;
    const most = Math.max(...rows.map((row) => row.stops.length));
    const room = this.canvas.parentElement.clientWidth - 4;
    const width = Math.min(8000, Math.max(room, LEFT + most * STOP_PIXELS));
    const height = TOP + rows.length * ROW + 6;
    const ratio = Math.min(devicePixelRatio || 1, 1.5);
    [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    this.canvas.style.width = `${width}px`;
    this.canvas.style.height = `${height}px`;
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(this.canvas);
    const colour = (name) => style.getPropertyValue(name);
    this.ink = colour("--ink");
    this.faint = colour("--faint");
    this.warn = colour("--stop");
    this.scale = (width - LEFT - 10) / Math.max(1, table.length_s);
    this.drawAxis(pen, table, height);
    const chain = new Set(table.chain.map(([id, stop]) => `${id}/${stop}`));
    rows.forEach((row, index) => this.drawRow(pen, row, index, chain));
    this.drawWaits(pen, rows);
    this.drawNow(pen, table, height);
  }

  x(time_s) {
    return LEFT + time_s * this.scale;
  }

  drawAxis(pen, table, height) {
    const step_s = [5, 10, 30, 60, 120, 300, 600, 1800, 3600].find((s) => s * this.scale >= 60) ?? 7200;
    pen.font = "11px system-ui, sans-serif";
    for (let at = 0; at <= table.length_s; at += step_s) {
      pen.fillStyle = this.faint;
      pen.fillRect(this.x(at), TOP - 4, 1, height - TOP);
      pen.fillText(minutes(at), this.x(at) + 3, 11);
    }
  }

  drawRow(pen, row, index, chain) {
    const top = TOP + index * ROW;
    const [red, green, blue] = this.model.colourOf(row.vehicle);
    const done = row.stops.indexOf(row.done);
    pen.fillStyle = this.ink;
    pen.font = "bold 13px system-ui, sans-serif";
    pen.fillText(String(row.vehicle), 4, top + 17);
    pen.font = "10px system-ui, sans-serif";
    row.stops.forEach((stop, at) => {
      const [from, to] = row.times_s[at].map((time_s) => this.x(time_s));
      const width = Math.max(2, to - from - 1);
      const isDone = row.isFollowed && at <= done;
      const isEntered = row.isFollowed && stop === row.leg;
      pen.fillStyle = `rgba(${red}, ${green}, ${blue}, ${isDone ? 1 : isEntered ? 0.5 : 0.12})`;
      pen.fillRect(from, top + 4, width, ROW - 12);
      const isLongest = chain.has(`${row.vehicle}/${stop}`);
      pen.strokeStyle = isLongest ? this.ink : `rgb(${red}, ${green}, ${blue})`;
      pen.lineWidth = isLongest ? 2.5 : 1;
      pen.strokeRect(from, top + 4, width, ROW - 12);
      if (width < 18) return;
      pen.fillStyle = this.ink;
      pen.fillText(isDone ? `✓${stop}` : isEntered ? `▶${stop}` : String(stop), from + 3, top + 17);
    });
  }

  /** From the end of what is waited for to the begin of what waits; those that are waited for now are thick. */
  drawWaits(pen, rows) {
    const places = new Map();
    rows.forEach((row, index) => row.stops.forEach((stop, at) => {
      places.set(`${row.vehicle}/${stop}`, { y: TOP + index * ROW + ROW / 2, times: row.times_s[at] });
    }));
    for (const row of rows) {
      const waits = new Set(row.waitsFor.map(([id, stop]) => `${id}/${stop}`));
      const next = row.stops[row.stops.indexOf(row.done) + 1];
      row.stops.forEach((stop, at) => {
        for (const [id, of] of row.after[at]) {
          const [from, to] = [places.get(`${id}/${of}`), places.get(`${row.vehicle}/${stop}`)];
          if (!from || !to) continue;
          const isNow = stop === next && waits.has(`${id}/${of}`);
          pen.strokeStyle = pen.fillStyle = isNow ? this.warn : this.faint;
          pen.lineWidth = isNow ? 2.5 : 0.8;
          arrow(pen, [this.x(from.times[1]), from.y], [this.x(to.times[0]), to.y], isNow ? 6 : 4);
        }
      });
    }
  }

  drawNow(pen, table, height) {
    pen.fillStyle = this.warn;
    pen.fillRect(this.x(table.reached_s) - 1, 0, 2, height);
    pen.font = "bold 11px system-ui, sans-serif";
    pen.fillText("now", this.x(table.reached_s) + 4, height - 2);
  }

  /** The same in words. */
  tell(table, rows) {
    const summary = document.getElementById("plan-summary");
    const list = document.getElementById("plan-waits");
    if (rows.length === 0) {
      summary.textContent = "No plans: the ground station makes them for a sweep, a calibration and fans.";
      list.replaceChildren();
      return;
    }
    const shown = chainText(table.chain);
    summary.textContent = `Run ${table.run}, revision ${table.revision}: ${minutes(table.reached_s)} of ${minutes(table.length_s)} `
      + `at ${table.speed_mps} m/s without turns. Longest chain (vehicle:stop, thick): ${shown}.`;
    const lines = waitsOf(rows).map(({ vehicle, of, stop }) => `${vehicle} waits for ${of}, stop ${stop}`);
    const items = (lines.length ? lines : ["nobody waits"]).map((line) => {
      const item = document.createElement("li");
      item.textContent = line;
      return item;
    });
    list.replaceChildren(...items);
  }
}

/** A chain of stops, where it goes from one vehicle to another: 2:0…7 → 1:3…9. */
function chainText(chain) {
  const pieces = [];
  for (const [id, stop] of chain) {
    const last = pieces.at(-1);
    if (last?.id === id) last.to = stop;
    else pieces.push({ id, from: stop, to: stop });
  }
  const texts = pieces.map(({ id, from, to }) => (from === to ? `${id}:${from}` : `${id}:${from}…${to}`));
  const shown = texts.length > 12 ? [...texts.slice(0, 6), "…", ...texts.slice(-5)] : texts;
  return shown.join(" → ");
}

/** Who waits for whom now. */
export function waitsOf(rows) {
  return rows.flatMap((row) => row.waitsFor.map(([of, stop]) => ({ vehicle: row.vehicle, of, stop })));
}

/** A line with a head at its end. @param {number[]} from @param {number[]} to */
export function arrow(pen, from, to, head) {
  const [[x0, y0], [x1, y1]] = [from, to];
  const angle = Math.atan2(y1 - y0, x1 - x0);
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
  pen.beginPath();
  pen.moveTo(x1, y1);
  pen.lineTo(x1 - head * Math.cos(angle - 0.5), y1 - head * Math.sin(angle - 0.5));
  pen.lineTo(x1 - head * Math.cos(angle + 0.5), y1 - head * Math.sin(angle + 0.5));
  pen.closePath();
  pen.fill();
}

function minutes(time_s) {
  const whole = Math.round(time_s);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
