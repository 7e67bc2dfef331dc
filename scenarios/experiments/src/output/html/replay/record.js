// The record of a run, and what holds at a time of it. Units here: seconds and metres.

/** Index of the last of `times` that is not after `time`; -1 if all are. */
function lastBefore(times, time) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Splits a flat list of rows with `columns` numbers each into times in seconds and the other columns. */
function table(flat, columns) {
  const rows = flat.length / columns;
  const times = new Float64Array(rows);
  const values = [];
  for (let column = 1; column < columns; column += 1) values.push(new Int32Array(rows));
  for (let row = 0; row < rows; row += 1) {
    times[row] = flat[row * columns] / 1000;
    for (let column = 1; column < columns; column += 1) {
      values[column - 1][row] = flat[row * columns + column];
    }
  }
  return { times, values };
}

/** A track: each point is stored as the difference from the one before, in milliseconds and centimetres. */
function track(deltas) {
  const rows = deltas.length / 4;
  const points = { times: new Float64Array(rows), north: new Float64Array(rows), east: new Float64Array(rows), height: new Float64Array(rows) };
  const sum = [0, 0, 0, 0];
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < 4; column += 1) sum[column] += deltas[row * 4 + column];
    points.times[row] = sum[0] / 1000;
    points.north[row] = sum[1] / 100;
    points.east[row] = sum[2] / 100;
    points.height[row] = sum[3] / 100;
  }
  return points;
}

/** What is known of a drone or relay, with `now`: its place and state at the time of the last `RunRecord.look`. */
function decodedNode(data) {
  return {
    id: data.id,
    swarm: data.swarm,
    fixed: data.fixed === true,
    track: track(data.track),
    states: table(data.states, 2),
    routes: table(data.routes, 4),
    epochs: table(data.epochs, 2),
    conditions: table(data.conditions, 2),
    tookOff: data.air[0] < 0 ? Infinity : data.air[0] / 1000,
    landed: data.air[1] < 0 ? Infinity : data.air[1] / 1000,
    now: {
      north: 0, east: 0, height: 0, state: -1, waypoint: -1, condition: 0, epoch: -1,
      hops: -1, parent: -1, relays: false, flies: false, isOut: false, leads: false,
    },
  };
}

/** Conditions, by their index in the record. */
const RUNS = 0;
const HANGS = 1;
const STOPPED = 2;

class RunRecord {
  constructor(data) {
    this.isMoment = data.end <= 0;
    this.end = Math.max(data.end / 1000, 0.001);
    this.range = data.range / 100;
    this.required = data.separation.map((it) => it / 100);
    this.swarms = data.swarms.map((swarm) => ({
      name: swarm.name,
      waypoints: swarm.waypoints.map(([north, east, height]) => ({ north: north / 100, east: east / 100, height: height / 100 })),
    }));
    this.states = data.states.map(([name, waypoint]) => ({ name, waypoint, isOver: name === "finished" }));
    this.conditions = data.conditions;
    this.epochs = data.epochs.map((epoch) => ({ ...epoch, since: epoch.since / 1000 }));
    this.nodes = data.nodes.map(decodedNode);
    this.byId = new Map(this.nodes.map((node) => [node.id, node]));
    this.marks = data.marks.map((mark) => ({
      at: mark.at / 1000,
      until: mark.until < 0 ? null : mark.until / 1000,
      kind: data.kinds[mark.kind],
      nodes: mark.nodes,
      text: mark.text,
    }));
    this.jams = data.jams.map(([at, until, north, east, radius]) => ({
      at: at / 1000, until: until < 0 ? Infinity : until / 1000, north: north / 100, east: east / 100, radius: radius / 100,
    }));
    this.links = data.links && data.links.map(([a, b, ...changes]) => ({ a: this.byId.get(a), b: this.byId.get(b), ...table(changes, 2) }));
    this.closest = { step: data.closest.step / 1000, pairs: data.closest.pairs };
    this.values = data.values.series.map(({ name, lines, thinned }) => ({
      name, thinned, lines: lines.map(({ drone, times, values }) => ({ drone, values, times: times.map((time) => time / 1000) })),
    }));
    this.omittedValues = data.values.omitted;
  }

  /** Sets `now` of all nodes to what holds at `time`. */
  look(time) {
    for (const node of this.nodes) this.lookAt(node, time);
  }

  lookAt(node, time) {
    const now = node.now;
    this.place(node, time, now);
    const state = lastBefore(node.states.times, time);
    now.state = state < 0 ? -1 : node.states.values[0][state];
    now.waypoint = now.state < 0 ? -1 : this.states[now.state].waypoint;
    const condition = lastBefore(node.conditions.times, time);
    now.condition = condition < 0 ? RUNS : node.conditions.values[0][condition];
    const epoch = lastBefore(node.epochs.times, time);
    now.epoch = epoch < 0 ? -1 : node.epochs.values[0][epoch];
    const route = lastBefore(node.routes.times, time);
    now.hops = route < 0 ? -1 : node.routes.values[0][route];
    now.parent = route < 0 ? -1 : node.routes.values[1][route];
    now.relays = route >= 0 && node.routes.values[2][route] === 1;
    now.flies = node.tookOff <= time && time < node.landed;
    const isOver = now.state >= 0 && this.states[now.state].isOver;
    now.isOut = now.condition > STOPPED || isOver || (!node.fixed && time >= node.landed);
    now.leads = now.epoch >= 0 && this.epochs[now.epoch].master === node.id && !now.isOut && now.condition !== STOPPED;
  }

  /** Writes a node's place at `time` into `place`. */
  place(node, time, place) {
    const { times, north, east, height } = node.track;
    const last = times.length - 1;
    if (last < 0) return;
    const from = Math.max(lastBefore(times, time), 0);
    const to = Math.min(from + 1, last);
    const span = times[to] - times[from];
    const share = span > 0 ? Math.min(Math.max((time - times[from]) / span, 0), 1) : 0;
    place.north = north[from] + (north[to] - north[from]) * share;
    place.east = east[from] + (east[to] - east[from]) * share;
    place.height = height[from] + (height[to] - height[from]) * share;
  }

  /** Quality of a link at `time`: 0 down, 1 weak, 2 up. */
  quality(link, time) {
    const change = lastBefore(link.times, time);
    return change < 0 ? 0 : link.values[0][change];
  }

  /** The closest two flying drones at `time`; null if fewer than two fly. */
  closestAt(time) {
    const sample = Math.min(Math.round(time / this.closest.step), this.closest.pairs.length / 3 - 1);
    const [distance, a, b] = this.closest.pairs.slice(sample * 3, sample * 3 + 3);
    return distance >= 0 ? { distance: distance / 100, a, b } : null;
  }

  /** Groups of nodes that take part at the time of the last look, by the leader epoch that they follow. */
  groups() {
    const groups = new Map();
    for (const node of this.nodes) {
      if (node.fixed || node.now.isOut || node.now.condition === STOPPED) continue;
      if (!groups.has(node.now.epoch)) groups.set(node.now.epoch, { epoch: node.now.epoch, members: [], leader: null });
      const group = groups.get(node.now.epoch);
      group.members.push(node);
      if (node.now.leads) group.leader = node;
    }
    return [...groups.values()].sort((a, b) => a.epoch - b.epoch);
  }

  /** The smallest rectangle around places. */
  static extent(places) {
    const box = { south: Infinity, north: -Infinity, west: Infinity, east: -Infinity };
    for (const { north, east } of places) {
      box.south = Math.min(box.south, north);
      box.north = Math.max(box.north, north);
      box.west = Math.min(box.west, east);
      box.east = Math.max(box.east, east);
    }
    return box.south <= box.north ? box : { south: -50, north: 50, west: -50, east: 50 };
  }

  /** Around all tracks and waypoints. */
  wholeExtent() {
    const places = this.swarms.flatMap((swarm) => swarm.waypoints);
    for (const { track: points } of this.nodes) {
      for (let row = 0; row < points.times.length; row += 1) places.push({ north: points.north[row], east: points.east[row] });
    }
    return RunRecord.extent(places);
  }

  /** Around the nodes that take part at the time of the last look; around all nodes if none does. */
  swarmExtent() {
    const live = this.nodes.filter((node) => node.now.flies);
    return RunRecord.extent((live.length > 0 ? live : this.nodes).map((node) => node.now));
  }
}
