// What is drawn over time: who follows whom, altitudes, and the closest pair. Each plot is drawn once; only its cursor moves.

/** Distance of the time axis from both ends of the canvas: half the width of the slider's thumb. */
const INSET = 10;

/** A canvas over time with a cursor. `paint(plot)` draws it whenever its size, its theme or the selection changes. */
class TimePlot {
  constructor(canvas, record, theme, paint) {
    Object.assign(this, { canvas, record, theme, paint });
    this.picture = document.createElement("canvas");
    this.isStale = true;
  }

  x(time) {
    return INSET + (time / this.record.end) * (this.width - 2 * INSET);
  }

  timeAt(px) {
    return ((px - INSET) / (this.width - 2 * INSET)) * this.record.end;
  }

  draw(time) {
    const { context, width, height } = sized(this.canvas);
    if (this.canvas.width === 0 || this.canvas.height === 0) return;
    if (this.isStale || width !== this.width || height !== this.height) this.repaint(width, height);
    context.clearRect(0, 0, width, height);
    context.drawImage(this.picture, 0, 0, width, height);
    context.fillStyle = this.theme.get("--ink");
    context.fillRect(Math.round(this.x(time)) - 1, 0, 2, height);
  }

  repaint(width, height) {
    Object.assign(this, { width, height, isStale: false });
    this.picture.width = this.canvas.width;
    this.picture.height = this.canvas.height;
    const context = this.picture.getContext("2d");
    context.setTransform(this.canvas.width / width, 0, 0, this.canvas.height / height, 0, 0);
    context.font = "12px system-ui, sans-serif";
    context.lineJoin = "round";
    this.context = context;
    this.paint(this);
  }
}

/** Grid lines at round times, labelled below. */
function paintTimes(plot) {
  const { context, theme, record, width, height } = plot;
  // A run without duration has no other time than its start.
  const step = record.isMoment ? Infinity : roundStep((record.end * 70) / width);
  context.strokeStyle = theme.get("--grid");
  context.fillStyle = theme.get("--soft");
  context.lineWidth = 1;
  context.textAlign = "center";
  for (let time = 0; time <= record.end; time += step) {
    const x = Math.round(plot.x(time)) + 0.5;
    context.beginPath();
    context.moveTo(x, 0);
    context.lineTo(x, height - 16);
    context.stroke();
    const half = context.measureText(`${time} s`).width / 2;
    context.fillText(`${+time.toFixed(3)} s`, Math.min(Math.max(x, half), width - half), height - 3);
  }
}

/** Grid lines at values, labelled with their unit at the left, inside the plot. */
function paintValues(plot, values, y, unit = " m") {
  const { context, theme, width } = plot;
  context.textAlign = "left";
  for (const value of values) {
    const at = Math.round(y(value)) + 0.5;
    context.strokeStyle = theme.get("--grid");
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(INSET, at);
    context.lineTo(width - INSET, at);
    context.stroke();
    context.fillStyle = theme.get("--soft");
    context.strokeStyle = theme.get("--ground");
    context.lineWidth = 3;
    context.strokeText(`${value}${unit}`, INSET + 3, at - 3);
    context.fillText(`${value}${unit}`, INSET + 3, at - 3);
  }
}

/** Spans of marks above; below, the share of the drones that follow each leader epoch, over time. */
function paintLeaders(plot) {
  const { context, record, theme, width, height } = plot;
  context.clearRect(0, 0, width, height);
  const top = 10;
  for (let x = INSET; x < width - INSET; x += 1) {
    record.look(plot.timeAt(x + 0.5));
    const groups = record.groups();
    const all = record.nodes.length;
    let y = top;
    for (const { epoch, members } of groups) {
      const part = (members.length / all) * (height - top);
      context.fillStyle = theme.epoch(epoch);
      context.fillRect(x, y, 1.5, part);
      y += part;
    }
  }
  for (const mark of record.marks) {
    if (mark.until === null || mark.until - mark.at <= 0) continue;
    context.fillStyle = theme.kind(mark.kind);
    const [from, to] = [plot.x(mark.at), plot.x(Math.min(mark.until, record.end))];
    context.fillRect(from, mark.kind === "election" ? 5 : 0, Math.max(to - from, 2), 4);
  }
  paintWaypoints(plot, top);
}

/** A tick with its number where the last drone left each waypoint. */
function paintWaypoints(plot, top) {
  const { context, record, theme, height } = plot;
  context.font = "bold 11px system-ui, sans-serif";
  context.textAlign = "center";
  let free = -Infinity;
  for (const mark of record.marks) {
    if (mark.kind !== "waypoint") continue;
    const x = plot.x(mark.at);
    context.fillStyle = theme.get("--card");
    context.fillRect(Math.round(x) - 1, top, 2, height - top);
    const number = mark.text.replace(/\D/g, "");
    const half = context.measureText(number).width / 2 + 5;
    if (x - half < free) continue;
    free = x + half;
    context.beginPath();
    context.roundRect(x - half, top + 3, 2 * half, 16, 8);
    context.fill();
    context.fillStyle = theme.get("--ink");
    context.fillText(number, x, top + 15);
  }
}

/** The height of each drone above home; the selected one's is bold. */
function paintAltitudes(plot) {
  const { context, record, theme, height } = plot;
  let highest = 1;
  for (const { track: points } of record.nodes) highest = points.height.reduce((a, b) => Math.max(a, b), highest);
  const y = (metres) => 14 + (1 - metres / highest) * (height - 34);
  paintTimes(plot);
  const step = roundStep(highest / 3);
  const values = [];
  for (let value = 0; value <= highest; value += step) values.push(+value.toFixed(2));
  const drones = record.nodes.filter((node) => !node.fixed && node !== plot.selected);
  if (plot.selected && !plot.selected.fixed) drones.push(plot.selected);
  for (const node of drones) {
    const isSelected = node === plot.selected;
    context.globalAlpha = isSelected ? 1 : drones.length > 30 ? 0.3 : 0.55;
    context.lineWidth = isSelected ? 3 : 1.4;
    paintAltitude(plot, node, y, isSelected);
  }
  context.globalAlpha = 1;
  paintValues(plot, values, y);
}

/** A drone's altitude, in the colour of the leader epoch that it follows; red once it is dead. */
function paintAltitude(plot, node, y, isSelected) {
  const { context, record, theme } = plot;
  const { times, height } = node.track;
  const place = { north: 0, east: 0, height: 0 };
  const changes = [...node.epochs.times, ...node.conditions.times];
  const ends = [...new Set([0, ...changes, record.end])].filter((time) => time <= record.end).sort((a, b) => a - b);
  for (let part = 0; part + 1 < ends.length; part += 1) {
    const [from, to] = [ends[part], ends[part + 1]];
    record.lookAt(node, from);
    context.strokeStyle = node.now.condition > STOPPED ? theme.get("--bad") : theme.epoch(node.now.epoch);
    if (isSelected && node.now.epoch < 0) context.strokeStyle = theme.get("--ink");
    context.beginPath();
    context.moveTo(plot.x(from), y(node.now.height));
    for (let row = lastBefore(times, from) + 1; row < times.length && times[row] < to; row += 1) {
      context.lineTo(plot.x(times[row]), y(height[row]));
    }
    record.place(node, to, place);
    context.lineTo(plot.x(to), y(place.height));
    context.stroke();
  }
}

/** The distance of the closest two flying drones, on a logarithmic scale, and the least that is required over ground. */
function paintClosest(plot) {
  const { context, record, theme, width, height } = plot;
  const { step, pairs } = record.closest;
  let [least, most] = [Math.max(record.required[0], 1), 2];
  for (let at = 0; at < pairs.length; at += 3) {
    if (pairs[at] < 0) continue;
    least = Math.min(least, Math.max(pairs[at] / 100, 0.5));
    most = Math.max(most, pairs[at] / 100);
  }
  [least, most] = [least * 0.8, most * 1.3];
  const y = (metres) => 12 + (1 - Math.log(Math.max(metres, least) / least) / Math.log(most / least)) * (height - 32);
  paintTimes(plot);
  const values = [];
  for (let power = 0.1; power < most; power *= 10) {
    for (const factor of [1, 2, 5]) values.push(+(factor * power).toFixed(2));
  }
  let shown = values.filter((value) => value > least && value < most);
  if (shown.length > 6) shown = shown.filter((value) => Math.abs(Math.log10(value) % 1) < 1e-6);
  context.strokeStyle = theme.get("--accent");
  context.lineWidth = 2;
  context.beginPath();
  let isDrawing = false;
  for (let sample = 0; sample * 3 < pairs.length; sample += 1) {
    const distance = pairs[sample * 3] / 100;
    if (distance >= 0) {
      if (isDrawing) context.lineTo(plot.x(sample * step), y(distance));
      else context.moveTo(plot.x(sample * step), y(distance));
    }
    isDrawing = distance >= 0;
  }
  context.stroke();
  context.strokeStyle = theme.get("--bad");
  context.setLineDash([5, 4]);
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(INSET, y(record.required[0]));
  context.lineTo(width - INSET, y(record.required[0]));
  context.stroke();
  context.setLineDash([]);
  paintValues(plot, shown, y);
}
