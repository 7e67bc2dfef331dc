// The map: drones, links and routes on the ground.

/** Seconds of a track that are drawn behind a drone. */
const TRAIL = 25;
/** Seconds for which a mark's drones are encircled, at normal speed. */
const RIPPLE = 2.5;
/** Marks that a ripple shows on the map. */
const RIPPLES = new Set(["death", "leader", "return", "fault"]);

/** The map: who is where at a time. */
class SwarmMap extends Ground {
  constructor(canvas, record, theme) {
    super(canvas, record, theme);
    this.shows = { links: true, tree: true, trails: true, names: true };
    this.selected = null;
    this.markTimes = record.marks.map((mark) => mark.at);
  }

  /** The node drawn nearest to a point of the canvas, within a finger's width. */
  nodeAt(px, py) {
    let best = null;
    let least = 24;
    for (const node of this.record.nodes) {
      const distance = Math.hypot(this.x(node.now.east) - px, this.y(node.now.north) - py);
      if (distance < least) [best, least] = [node, distance];
    }
    return best;
  }

  draw(time, speed) {
    const { context, width, height } = sized(this.canvas);
    this.context = context;
    this.size = { width, height };
    context.fillStyle = this.theme.get("--ground");
    context.fillRect(0, 0, width, height);
    context.font = "12px system-ui, sans-serif";
    context.lineJoin = "round";
    this.drawGrid();
    this.drawJams(time);
    this.drawWaypoints();
    if (this.shows.trails) this.drawTrails(time);
    if (this.shows.links && this.record.links) this.drawLinks(time);
    if (this.shows.tree) this.drawTree(time);
    this.drawRoute();
    this.drawRipples(time, speed);
    for (const node of this.drawingOrder()) this.drawNode(node);
    if (this.shows.names) this.drawNames();
    this.drawScale();
  }

  drawTrails(time) {
    const { context } = this;
    context.lineWidth = 2;
    context.globalAlpha = 0.35;
    for (const node of this.record.nodes) {
      if (node.fixed || time < node.tookOff) continue;
      const { times, north, east } = node.track;
      const until = Math.min(time, times[times.length - 1]);
      const from = time - TRAIL;
      if (until <= from) continue;
      const place = { north: 0, east: 0, height: 0 };
      this.record.place(node, from, place);
      context.strokeStyle = this.theme.epoch(node.now.epoch);
      context.beginPath();
      context.moveTo(this.x(place.east), this.y(place.north));
      for (let row = lastBefore(times, from) + 1; row < times.length && times[row] < until; row += 1) {
        context.lineTo(this.x(east[row]), this.y(north[row]));
      }
      context.lineTo(this.x(node.now.east), this.y(node.now.north));
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  /** All links at the time: weak ones dotted. */
  drawLinks(time) {
    const { context, record } = this;
    context.strokeStyle = this.theme.get("--soft");
    // Thousands of links are a mesh, not a grey area.
    context.globalAlpha = Math.min(0.38, Math.max(0.05, 40 / record.links.length));
    context.lineWidth = 1;
    for (const quality of [2, 1]) {
      context.setLineDash(quality === 1 ? [2, 5] : []);
      // Paths of some hundred lines are drawn faster than one of thousands.
      let lines = 0;
      context.beginPath();
      for (const link of record.links) {
        if (record.quality(link, time) !== quality) continue;
        context.moveTo(this.x(link.a.now.east), this.y(link.a.now.north));
        context.lineTo(this.x(link.b.now.east), this.y(link.b.now.north));
        lines += 1;
        if (lines % 200 === 0) {
          context.stroke();
          context.beginPath();
        }
      }
      context.stroke();
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  /** From each node to its parent, dashed if the parent is out. */
  drawTree() {
    const { context } = this;
    context.lineWidth = this.record.nodes.length > 40 ? 1.5 : 2.2;
    for (const node of this.record.nodes) {
      const parent = this.parentOf(node);
      if (!parent) continue;
      context.strokeStyle = this.theme.epoch(node.now.epoch);
      context.setLineDash(parent.now.isOut || parent.now.condition !== RUNS ? [4, 5] : []);
      context.beginPath();
      context.moveTo(this.x(node.now.east), this.y(node.now.north));
      context.lineTo(this.x(parent.now.east), this.y(parent.now.north));
      context.stroke();
    }
    context.setLineDash([]);
  }

  parentOf(node) {
    const { now } = node;
    if (now.parent < 0 || now.isOut || now.leads || now.condition === STOPPED) return null;
    return this.record.byId.get(now.parent) ?? null;
  }

  /** Route from the selected drone to its master. */
  drawRoute() {
    if (!this.selected) return;
    const { context } = this;
    context.strokeStyle = this.theme.get("--ink");
    context.lineWidth = 4;
    context.globalAlpha = 0.5;
    context.beginPath();
    context.moveTo(this.x(this.selected.now.east), this.y(this.selected.now.north));
    const seen = new Set();
    for (let node = this.parentOf(this.selected); node && !seen.has(node); node = this.parentOf(node)) {
      seen.add(node);
      context.lineTo(this.x(node.now.east), this.y(node.now.north));
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  /** Rings around the drones of what has just happened. */
  drawRipples(time, speed) {
    const { context, record } = this;
    const lasts = RIPPLE * Math.max(1, speed);
    context.lineWidth = 3;
    for (let index = lastBefore(this.markTimes, time); index >= 0; index -= 1) {
      const mark = record.marks[index];
      const share = (time - mark.at) / lasts;
      if (share > 1) break;
      if (!RIPPLES.has(mark.kind)) continue;
      context.strokeStyle = this.theme.kind(mark.kind);
      context.globalAlpha = 1 - share;
      for (const id of mark.nodes) {
        const node = record.byId.get(id);
        if (!node) continue;
        context.beginPath();
        context.arc(this.x(node.now.east), this.y(node.now.north), 10 + 34 * share, 0, 2 * Math.PI);
        context.stroke();
      }
    }
    context.globalAlpha = 1;
  }

  /** Those that are out first, leaders and the selected one last, on top. */
  drawingOrder() {
    const order = (node) => (node === this.selected ? 3 : node.now.leads ? 2 : node.now.isOut ? 0 : 1);
    return [...this.record.nodes].sort((a, b) => order(a) - order(b));
  }

  radius() {
    return this.record.nodes.length > 40 ? 5 : 7;
  }

  drawNode(node) {
    const { context, theme } = this;
    const { now } = node;
    const [x, y, r] = [this.x(now.east), this.y(now.north), this.radius()];
    if (node === this.selected) {
      context.strokeStyle = theme.get("--ink");
      context.lineWidth = 2.5;
      context.beginPath();
      context.arc(x, y, r + 7, 0, 2 * Math.PI);
      context.stroke();
    }
    if (now.condition > STOPPED) return this.drawDead(x, y, r);
    context.lineWidth = 2;
    context.beginPath();
    this.outline(node, x, y, r);
    if (now.isOut || now.condition !== RUNS) {
      context.fillStyle = theme.get("--ground");
      context.strokeStyle = now.condition === RUNS ? theme.get("--soft") : theme.get("--fault");
      if (now.condition !== RUNS) context.setLineDash([3, 2]);
    } else {
      context.fillStyle = theme.epoch(now.epoch);
      context.strokeStyle = theme.get("--card");
    }
    context.fill();
    context.stroke();
    context.setLineDash([]);
  }

  /** Diamond for a leader, square for a relay, triangle for a mast, disc for others. */
  outline(node, x, y, r) {
    const { context } = this;
    if (node.now.leads) {
      const half = r * 1.75;
      context.moveTo(x, y - half);
      context.lineTo(x + half, y);
      context.lineTo(x, y + half);
      context.lineTo(x - half, y);
      context.closePath();
    } else if (node.fixed) {
      context.moveTo(x, y - r * 1.2);
      context.lineTo(x + r * 1.2, y + r);
      context.lineTo(x - r * 1.2, y + r);
      context.closePath();
    } else if (node.now.relays) {
      context.rect(x - r * 0.9, y - r * 0.9, r * 1.8, r * 1.8);
    } else {
      context.arc(x, y, r, 0, 2 * Math.PI);
    }
  }

  drawDead(x, y, r) {
    const { context } = this;
    context.beginPath();
    context.arc(x, y, r + 4, 0, 2 * Math.PI);
    context.fillStyle = this.theme.get("--card");
    context.fill();
    context.strokeStyle = this.theme.get("--bad");
    context.lineWidth = 2;
    context.stroke();
    context.lineWidth = 3;
    context.beginPath();
    const half = r * 0.7;
    context.moveTo(x - half, y - half);
    context.lineTo(x + half, y + half);
    context.moveTo(x + half, y - half);
    context.lineTo(x - half, y + half);
    context.stroke();
  }

  /** Ids beside drones, where there is room; those of leaders and of drones that are out first. */
  drawNames() {
    const { context, theme } = this;
    const cellAt = (x, y) => `${Math.floor(x / 12)} ${Math.floor(y / 12)}`;
    const taken = new Set(this.record.nodes.map(({ now }) => cellAt(this.x(now.east), this.y(now.north))));
    context.textAlign = "left";
    context.lineWidth = 3;
    context.strokeStyle = theme.get("--ground");
    for (const node of this.drawingOrder().reverse()) {
      const { now } = node;
      const trouble = now.condition !== RUNS ? ` ${this.record.conditions[now.condition]}` : "";
      // Trouble is written below, for its words would cover the id of the next drone.
      const [x, y] = [this.x(now.east) + this.radius() + 5, this.y(now.north) + (trouble ? 18 : -1 - this.radius())];
      const text = `${node.id}${trouble}`;
      const cells = Math.ceil((text.length * 7) / 12);
      const place = Array.from({ length: cells }, (_, cell) => cellAt(x + cell * 12, y - 5));
      if (node !== this.selected && place.some((cell) => taken.has(cell))) continue;
      place.forEach((cell) => taken.add(cell));
      context.font = now.leads || trouble ? "bold 13px system-ui, sans-serif" : "12px system-ui, sans-serif";
      context.strokeText(text, x, y);
      context.fillStyle = trouble ? theme.get(now.condition > STOPPED ? "--bad" : "--fault") : theme.get("--ink");
      context.fillText(text, x, y);
    }
  }
}
