// The ground of the map, seen from above, north up.

/** Smallest extent that the map shows, in metres. */
const EXTENT_MIN = 40;

/** A canvas with a camera, and what does not move on it. */
class Ground {
  constructor(canvas, record, theme) {
    this.canvas = canvas;
    this.record = record;
    this.theme = theme;
    this.camera = { north: 0, east: 0, scale: 1 };
    this.whole = record.wholeExtent();
    this.mode = "whole";
    this.size = { width: 0, height: 0 };
  }

  /** The camera that shows an extent. */
  cameraFor(box) {
    const { width, height } = this.size;
    const [east, north] = [Math.max(box.east - box.west, EXTENT_MIN), Math.max(box.north - box.south, EXTENT_MIN)];
    return {
      north: (box.north + box.south) / 2,
      east: (box.east + box.west) / 2,
      scale: Math.min((width - 90) / east, (height - 100) / north),
    };
  }

  /** Moves the camera to what its mode shows; at once, or by a `share` of the way. */
  aim(share = 1) {
    if (this.mode === "free") return;
    const goal = this.cameraFor(this.mode === "whole" ? this.whole : this.record.swarmExtent());
    for (const key of ["north", "east", "scale"]) this.camera[key] += (goal[key] - this.camera[key]) * share;
  }

  x(east) {
    return this.size.width / 2 + (east - this.camera.east) * this.camera.scale;
  }

  /** The vertical middle of what the buttons leave free. */
  middle() {
    return this.size.height / 2 + 16;
  }

  y(north) {
    return this.middle() - (north - this.camera.north) * this.camera.scale;
  }

  /** Zooms by a factor about a point of the canvas. */
  zoom(factor, px = this.size.width / 2, py = this.middle()) {
    const scale = Math.min(Math.max(this.camera.scale * factor, 0.005), 60);
    const [dx, dy] = [px - this.size.width / 2, py - this.middle()];
    this.camera.east += dx / this.camera.scale - dx / scale;
    this.camera.north -= dy / this.camera.scale - dy / scale;
    this.camera.scale = scale;
    this.mode = "free";
  }

  pan(dx, dy) {
    this.camera.east -= dx / this.camera.scale;
    this.camera.north += dy / this.camera.scale;
    this.mode = "free";
  }

  drawGrid() {
    const { context, size } = this;
    const step = roundStep(80 / this.camera.scale);
    context.strokeStyle = this.theme.get("--grid");
    context.lineWidth = 1;
    context.beginPath();
    const west = this.camera.east - size.width / 2 / this.camera.scale;
    const south = this.camera.north - (size.height - this.middle()) / this.camera.scale;
    for (let east = Math.ceil(west / step) * step; this.x(east) < size.width; east += step) {
      context.moveTo(Math.round(this.x(east)) + 0.5, 0);
      context.lineTo(Math.round(this.x(east)) + 0.5, size.height);
    }
    for (let north = Math.ceil(south / step) * step; this.y(north) > 0; north += step) {
      context.moveTo(0, Math.round(this.y(north)) + 0.5);
      context.lineTo(size.width, Math.round(this.y(north)) + 0.5);
    }
    context.stroke();
  }

  /** A length in metres at the lower left, and north at the upper left. */
  drawScale() {
    const { context, size } = this;
    const length = roundStep(70 / this.camera.scale);
    const [x, y] = [14, size.height - 14];
    context.strokeStyle = this.theme.get("--soft");
    context.fillStyle = this.theme.get("--soft");
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x, y - 5);
    context.lineTo(x, y);
    context.lineTo(x + length * this.camera.scale, y);
    context.lineTo(x + length * this.camera.scale, y - 5);
    context.stroke();
    context.textAlign = "left";
    context.fillText(`${length} m`, x + 4, y - 5);
    context.beginPath();
    context.moveTo(20, 12);
    context.lineTo(25, 26);
    context.lineTo(20, 23);
    context.lineTo(15, 26);
    context.fill();
    context.textAlign = "center";
    context.fillText("N", 20, 39);
  }

  drawJams(time) {
    const { context } = this;
    for (const jam of this.record.jams) {
      if (time < jam.at || time > jam.until) continue;
      context.beginPath();
      context.arc(this.x(jam.east), this.y(jam.north), jam.radius * this.camera.scale, 0, 2 * Math.PI);
      context.globalAlpha = 0.12;
      context.fillStyle = this.theme.get("--fault");
      context.fill();
      context.globalAlpha = 1;
      context.setLineDash([6, 4]);
      context.strokeStyle = this.theme.get("--fault");
      context.lineWidth = 1.5;
      context.stroke();
      context.setLineDash([]);
    }
  }

  drawWaypoints() {
    const { context } = this;
    context.textAlign = "center";
    for (const { waypoints } of this.record.swarms) {
      context.strokeStyle = this.theme.get("--line");
      context.lineWidth = 2;
      context.beginPath();
      for (const { north, east } of waypoints) context.lineTo(this.x(east), this.y(north));
      context.stroke();
      const names = new Map();
      waypoints.forEach(({ north, east }, index) => {
        const key = `${north} ${east}`;
        const at = names.get(key) ?? { north, east, numbers: [] };
        at.numbers.push(index);
        names.set(key, at);
      });
      for (const { north, east, numbers } of names.values()) this.drawPin(this.x(east), this.y(north), numbers);
    }
  }

  drawPin(x, y, numbers) {
    const { context } = this;
    const shown = numbers.length > 4 ? [...numbers.slice(0, 3), "…"] : numbers;
    const text = shown.join(", ");
    const half = context.measureText(text).width / 2 + 6;
    context.fillStyle = this.theme.get("--soft");
    context.beginPath();
    context.arc(x, y, 2.5, 0, 2 * Math.PI);
    context.moveTo(x, y - 6);
    context.lineTo(x - 4, y - 13);
    context.lineTo(x + 4, y - 13);
    context.fill();
    context.globalAlpha = 0.85;
    context.beginPath();
    context.roundRect(x - half, y - 29, 2 * half, 17, 8);
    context.fill();
    context.globalAlpha = 1;
    context.fillStyle = this.theme.get("--card");
    context.fillText(text, x, y - 16.5);
  }
}
